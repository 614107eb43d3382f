"""A yaw moment that depends on the place."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class PlaceMoment(Stranger):
    """Yaw moment N = M sin(2 pi x / 2 L) cos(2 pi y / 2 L) over north x and east y: eddies that stand still.

    Not a tether, which gives a force, towards one point, and no moment; not a current or its shear, which push
    rather than turn; not a constant moment, because its mean over the way is zero.
    """

    name = "stranger_place_moment"
    axis = "N"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the moment."""
        x, y = np.pi * seen.place[:, :2].T / seen.vehicle.length
        return cls.along(cls.moment(seen.vehicle) * np.sin(x) * np.cos(y))
