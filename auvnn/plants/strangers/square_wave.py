"""A force that a clock switches to and fro."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger

PERIOD = 8.0
"""s"""


class SquareWave(Stranger):
    """Sway force Y = F tanh(12 sin(2 pi t / 8 s)): a pump or a winch that is switched on the other side every 4 s.

    Not a constant force, because its mean is zero; not a wave, which is a sine that turns with the heading, moves
    the water, and shows in heave just as much; not a thruster, whose commands it does not know.
    """

    name = "stranger_square_wave"
    axis = "Y"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the force."""
        size = cls.force(seen.vehicle) * np.tanh(12.0 * np.sin(2.0 * np.pi * seen.t / PERIOD))
        return cls.along(np.full(len(seen.place), size))
