"""Something heavy that slides along the hull when it leans."""

from __future__ import annotations

from auvnn.plants.strangers.base import Array, Seen, Stranger

LEAN = 0.05
"""Sine of the lean at which half of the way is done."""


class LooseMass(Stranger):
    """Pitch moment M = M_0 d_y^2 / (d_y^2 + 0.05^2), d_y the sine of the lean to either side.

    Not a shifted centre of gravity, whose moment is linear in the direction of down; not a tilted vertical, which
    exerts no moment at all; it knows neither speed nor depth nor heading.
    """

    name = "stranger_loose_mass"
    axis = "M"

    @classmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the moment."""
        square = (seen.rotation[:, 2, 1] / LEAN) ** 2
        return cls.along(cls.moment(seen.vehicle) * square / (1.0 + square))
