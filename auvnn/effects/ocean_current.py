"""A steady current: water that moves as one, without turning."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Moment, Parameter


class OceanCurrent(Effect):
    """Steady irrotational current, constant in the world.

    nu_r = nu - [R^T v_c; 0], whose derivative holds the term omega x R^T v_c.
    Reference: Fossen (2011), section 8.3.
    """

    name = "ocean_current"
    cause = "the water moves over ground"
    symbol = "v_c"
    reference = "Fossen (2011), Handbook of Marine Craft Hydrodynamics and Motion Control, section 8.3"
    confused_with = ("constant_force", "tether", "velocity_misalignment", "current_shear")
    manoeuvre = "reciprocal"
    told_apart_by = (
        "the same speed on three headings or more: what comes from the water turns with the heading"
    )
    channels = ("psi",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the three components of the current, NED."""
        return tuple(
            Parameter(n, "m/s", 0.0, s, -5.0, 5.0)
            for n, s in (("v_north", 0.3), ("v_east", 0.3), ("v_down", 0.1))
        )

    def water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        """Return the current and no acceleration."""
        velocity = self.theta.to(moment.position).expand_as(moment.position)
        return velocity, velocity * 0
