"""Buoyancy that does not balance the weight as the model says."""

from __future__ import annotations

from typing import Any

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class NetBuoyancy(Effect):
    """Extra buoyancy, positive up, at the centre of buoyancy: B <- B + F.

    Reference: Fossen (2011), section 4.1.
    """

    name = "net_buoyancy"
    cause = "weight and buoyancy differ from the model's"
    symbol = "B - W"
    reference = "Fossen (2011), section 4.1"
    confused_with = ("payload", "compressibility", "constant_force", "tether")
    manoeuvre = "rotation"
    told_apart_by = "free ascent or descent, and large angles of roll and pitch"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the extra force; two per cent of the weight is plausible."""
        weight = float(vehicle.mass) * float(vehicle.gravity)
        return (Parameter("force", "N", 0.0, 0.02 * weight, -weight, weight),)

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add to the buoyancy."""
        return body.but(buoyancy=body.buoyancy + self.theta[0].to(body.buoyancy))
