"""Drag of the fins, which the vehicle's damping does not have."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Body, Moment, Parameter
from auvnn.effects.fin_parts import FinEffect
from auvnn.physics.fins import SHARPNESS, lift_coefficient
from auvnn.physics.products import matvec


class FinDrag(FinEffect):
    """Drag of every fin against its own flow: D = 1/2 rho A (C_D0 + k C_L(alpha)^2) |V| V.

    The first part acts at every angle, the second, induced by the lift, when the fins are turned: a vehicle that steers
    hard is slower. V is the velocity of the fin's centre through the water, across its axis; C_L has the stall and the
    angles of the effects before this one in the model, and not their factors: a wake takes from the lift alone.
    Reference: Hoerner (1965), Fluid-Dynamic Drag, chapters 6 and 7; k = 1 / (pi e AR).
    """

    name = "fin_drag"
    cause = "the fins drag, more so when they are turned"
    symbol = "C_D"
    reference = "Hoerner (1965), Fluid-Dynamic Drag, chapter 7"
    confused_with = ("quadratic_damping", "thruster_gain")
    manoeuvre = "survey"
    told_apart_by = "straight legs and turns at the same throttle"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the drag coefficient at no lift, and the factor on the square of the lift coefficient."""
        return (
            Parameter("zero_lift", "1", 0.0, 0.05, 0.0, 5.0),
            Parameter("induced", "1", 0.0, 0.3, 0.0, 10.0),
        )

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the drag."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        frame, area, slope, stall, density = (
            self.kept(n).to(moment.nu) for n in ("frame", "area", "lift_slope", "stall", "density")
        )
        rows = frame.flatten(-3, -2)
        flow = matvec(rows, moment.nu_r).unflatten(-1, (-1, 2))
        along, across = flow[..., 0], flow[..., 1]
        speed = torch.sqrt(along * along + across * across + 1e-30)
        inflow = torch.atan2(across, torch.where(speed > 1e-12, along, 1.0))
        now = self.now(moment)
        attack = torch.remainder(now.angles - inflow + 0.5 * torch.pi, torch.pi) - 0.5 * torch.pi
        lift = lift_coefficient(
            attack, slope, stall * now.stall, SHARPNESS * now.sharpness, now.separated, now.crossflow
        )
        zero_lift, induced = self.theta.to(moment.nu).unbind(-1)
        size = 0.5 * density * area * (zero_lift + induced * lift * lift) * speed
        return matvec(rows.mT, (-size.unsqueeze(-1) * flow).flatten(-2))
