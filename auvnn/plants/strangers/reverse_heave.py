"""A hull that rises or sinks when it goes astern."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class ReverseHeave(Stranger):
    """Heave force Z = F u^2 / (u^2 + u_0^2) for u < 0, nothing for u >= 0; u_0 = 0.05 sqrt(g L).

    Not coupled damping, which is odd in the speed and has no Z by u; not body lift, which needs an angle to the
    flow; not a net buoyancy, which is there at rest. A vehicle that never goes astern never feels it.
    """

    name = "stranger_reverse_heave"
    axis = "Z"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the force."""
        usual = 0.05 * np.sqrt(seen.vehicle.gravity * seen.vehicle.length)
        square = (np.minimum(seen.flow[:, 0], 0.0) / usual) ** 2
        return cls.along(cls.force(seen.vehicle) * square / (1.0 + square))
