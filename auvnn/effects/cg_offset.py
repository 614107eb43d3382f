"""A centre of gravity that is not where the model says."""

from __future__ import annotations

from typing import Any

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class CgOffset(Effect):
    """Shift of the centre of gravity; it moves the weight and, with it, the rigid body's inertia.

    Only W r_g - B r_b shows statically. Reference: Fossen (2011), sections 3.3 and 4.1.
    """

    name = "cg_offset"
    cause = "the centre of gravity is elsewhere"
    symbol = "r_g"
    reference = "Fossen (2011), section 4.1"
    confused_with = ("payload", "net_buoyancy", "constant_force")
    manoeuvre = "rotation"
    told_apart_by = "static angles of roll and pitch with the thrusters off"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the shift in body axes; a few per cent of the vehicle's length is plausible."""
        scale = 0.02 * float(vehicle.length)
        return tuple(
            Parameter(n, "m", 0.0, scale, -float(vehicle.length), float(vehicle.length)) for n in "xyz"
        )

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Move the centre of gravity."""
        shift = self.theta.to(body.cg)
        return body.but(cg=body.cg + shift, weight_centre=body.hangs + shift)
