"""A force that comes and goes three times a turn."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class HeadingForce(Stranger):
    """Surge force X = F sin(3 psi), as of a magnet's pull or a wind on something above the water.

    Not a current or a tether, whose force in the body goes with the first harmonic of the heading, not with the
    third; not a tilted vertical, which turns with the first harmonic too; no function of speed, depth or time.
    """

    name = "stranger_heading_force"
    axis = "X"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the force."""
        return cls.along(cls.force(seen.vehicle) * np.sin(3.0 * seen.heading))
