"""The bottom close below."""

from __future__ import annotations

from torch import Tensor

from auvnn.effects.hooks import Moment
from auvnn.effects.proximity import Proximity


class BottomProximity(Proximity):
    """Added mass and drag grow near the bottom, at the measured altitude: f = strength (R/h)^exponent.

    With it comes suction when sliding along the bottom and repulsion when closing in on it (see `Proximity`).
    Reference: Lamb (1932), section 137; Korotkin (2009), chapter 2; JMSE 13(6):1183 (2025) for the drag.
    """

    name = "bottom_proximity"
    cause = "added mass and drag grow near the bottom"
    symbol = "f(h)"
    reference = "Lamb (1932), section 137; Korotkin (2009), Added Masses of Ship Structures"
    confused_with = ("surface_proximity", "net_buoyancy")
    manoeuvre = "dives"
    told_apart_by = "the same commands at several heights above the bottom"
    plainer = ("added_mass",)
    channels = ("altitude",)

    def distance(self, moment: Moment) -> tuple[Tensor, float] | None:
        """Return the altitude, which falls with depth."""
        return None if moment.altitude is None else (moment.altitude.to(moment.nu), -1.0)
