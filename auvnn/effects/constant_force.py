"""A constant wrench in body axes: a bias that nothing else explains."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class ConstantForce(Effect):
    """Constant force and moment in body axes, such as a thruster's bias or a trim moment.

    tau <- tau + [X Y Z K M N]. Reference: Fossen (2011), section 8.1 (bias model).
    """

    name = "constant_force"
    cause = "a constant force or moment acts in body axes"
    symbol = "b"
    reference = "Fossen (2011), section 8.1"
    confused_with = ("net_buoyancy", "cg_offset", "ocean_current", "thruster_gain")
    manoeuvre = "reciprocal"
    told_apart_by = "legs on several headings, and drifting without thrust"
    plainer = ("net_buoyancy", "cg_offset")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the six components; two per cent of the weight, at a tenth of the length, is plausible."""
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        moment = 0.1 * force * float(vehicle.length)
        return tuple(
            Parameter(a, "N" if i < 3 else "N m", 0.0, (force, moment)[i >= 3], -1e6, 1e6)
            for i, a in enumerate(AXES)
        )

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the constant wrench."""
        return self.theta.to(moment.nu).expand_as(moment.nu)
