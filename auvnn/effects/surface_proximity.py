"""The free surface close above."""

from __future__ import annotations

from torch import Tensor

from auvnn.effects.hooks import Moment
from auvnn.effects.proximity import Proximity


class SurfaceProximity(Proximity):
    """Added mass and drag fall near the free surface: f = -strength (R/z)^exponent, z the depth.

    A free surface in fast motion is a boundary of no pressure: its image has the opposite sign of a wall's.
    It does not cover breaching, wave-making and ventilation. Reference: Faltinsen (1990), chapter 3.
    """

    name = "surface_proximity"
    cause = "added mass and drag fall near the surface"
    symbol = "f(z)"
    reference = "Faltinsen (1990), Sea Loads on Ships and Offshore Structures, chapter 3"
    confused_with = ("bottom_proximity", "net_buoyancy")
    manoeuvre = "dives"
    told_apart_by = "the same commands at several depths below the surface"
    plainer = ("added_mass",)
    channels = ("z",)
    sign = -1.0

    def distance(self, moment: Moment) -> tuple[Tensor, float] | None:
        """Return the depth."""
        return moment.position[..., 2], 1.0
