"""Lift that alternates with depth."""

from __future__ import annotations

import numpy as np

from auvnn.plants.strangers.base import Array, Seen, Stranger


class Layers(Stranger):
    """Vertical force, F sin(2 pi z / 1.5 L) downwards: thin layers of lighter and heavier water.

    Not compressibility, which is a straight line in depth, nor a net buoyancy, which is the same everywhere; not
    the bottom or the surface, whose forces fade with distance and go with the speed.
    """

    name = "stranger_layers"
    axis = "Z"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the force, along the vertical."""
        size = cls.force(seen.vehicle) * np.sin(2.0 * np.pi * seen.place[:, 2:] / (1.5 * seen.vehicle.length))
        return np.concatenate([size * seen.rotation[:, 2, :], np.zeros_like(seen.place)], axis=-1)
