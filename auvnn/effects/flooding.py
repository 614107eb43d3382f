"""Water that leaks into the hull."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class Flooding(Effect):
    """Mass and weight grow by a constant inflow at the centre of gravity: m(t) = m + rate t.

    The water that comes in has to be brought to the vehicle's speed: force -rate v_r at that point. Buoyancy
    stays, since the hull's volume does. Time is on the log's clock.
    Reference: Fossen (2011), sections 3.3 and 4.1, with a growing mass.
    """

    name = "flooding"
    cause = "water leaks into the hull"
    symbol = "m_dot"
    reference = "Fossen (2011), sections 3.3 and 4.1"
    confused_with = ("payload", "net_buoyancy")
    manoeuvre = "survey"
    told_apart_by = "a long run with the same legs early and late"
    plainer = ("net_buoyancy",)
    time_varying = True

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the inflow; a tenth of a per cent of the mass per second is a bad leak."""
        mass = float(vehicle.mass)
        return (Parameter("rate", "kg/s", 0.0, 2e-4 * mass, 0.0, 0.1 * mass),)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep gravity."""
        self.keep("gravity", vehicle.gravity)

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add the water that has come in."""
        assert moment is not None
        water = self.theta[0].to(moment.nu) * moment.time.to(moment.nu)
        heavier = body.but(mass=body.mass + water)
        return heavier.hung(self.kept("gravity").to(water) * water, body.cg)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what it takes to carry the water along."""
        v, omega = moment.nu_r[..., :3], moment.nu_r[..., 3:]
        place = body.cg.expand_as(v)
        force = -self.theta[0].to(v) * (v + torch.linalg.cross(omega, place))
        return torch.cat([force, torch.linalg.cross(place, force)], dim=-1)
