"""Thrust that depends on the vehicle's pitch."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class PitchThrust(Stranger):
    """Surge thrust X <- X (1 + 0.4 tanh(theta / 0.05)): the propellers draw air, or silt, at one end only.

    Not a thruster's gain, which is the same at every pitch; not inflow loss or battery droop, which know speed
    and voltage; it vanishes with the thrust, so no force of attitude alone, such as a centre of gravity's, is it.
    A strength of one is here this share of the thrust, not of the weight.
    """

    name = "stranger_pitch_thrust"
    axis = "X"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the change of the thrust."""
        return cls.along(0.4 * np.tanh(seen.pitch / 0.05) * seen.thrust[:, 0])
