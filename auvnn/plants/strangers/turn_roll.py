"""A roll moment whenever the vehicle turns, whichever way."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class TurnRoll(Stranger):
    """Roll moment K = M r^2 / (r^2 + r_0^2), r_0 = 0.05 sqrt(g / L): a heeling moment with one sign only.

    Not coupled damping or turning forces, which are odd in the turn rate or go with the speed; not a shifted
    centre of gravity or a constant moment, which are there at rest too.
    """

    name = "stranger_turn_roll"
    axis = "K"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the moment."""
        usual = 0.05 * np.sqrt(seen.vehicle.gravity / seen.vehicle.length)
        square = (seen.turn[:, 2] / usual) ** 2
        return cls.along(cls.moment(seen.vehicle) * square / (1.0 + square))
