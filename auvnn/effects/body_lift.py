"""Lift of the hull at an angle to the flow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import volume


class BodyLift(Effect):
    """Lift and its moment in the relative velocity, with SNAME's signs.

    Y = Y_uv u v, Z = Z_uw u w, M = M_uw u w, N = N_uv u v. Lift resists sideways motion, so Y_uv and Z_uw are
    negative for u > 0; it acts aft, at x = -l, so that M_uw = l Z_uw < 0 and N_uv = -l Y_uv > 0, against the
    Munk moment, from which nothing but a known added mass can tell it.
    Reference: Prestero (2001), section 4.6; Hoerner and Borst (1985), chapter 19.
    """

    name = "body_lift"
    cause = "the hull gives lift at an angle to the flow"
    symbol = "Y_uv"
    reference = "Prestero (2001), body lift; Hoerner and Borst (1985), Fluid-Dynamic Lift"
    confused_with = ("munk_moment", "coupled_damping", "added_mass_coriolis")
    manoeuvre = "oblique"
    told_apart_by = "steady speed at several angles of drift and attack"
    plainer = ("munk_moment",)
    contains: ClassVar = {"munk_moment": ()}

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the coefficients; plausible is a lift coefficient of 0.5 of V^(2/3), 0.2 lengths aft."""
        force = 0.25 * float(vehicle.water_density) * volume(vehicle) ** (2 / 3)
        moment = 0.2 * float(vehicle.length) * force
        return tuple(
            Parameter(name, unit, 0.0, scale, -100 * scale, 100 * scale)
            for name, unit, scale in (
                ("Yuv", "kg/m", force),
                ("Zuw", "kg/m", force),
                ("Muw", "kg", moment),
                ("Nuv", "kg", moment),
            )
        )

    def onward(self, moment: Moment) -> Moment:
        """Return the moment with the lift, for what says later that some of it is lost."""
        return replace(moment, body_lift=self._attached(moment))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the lift."""
        lift = self._attached(moment)
        return lift if moment.lift_lost is None else (1.0 - moment.lift_lost).unsqueeze(-1) * lift

    def _attached(self, moment: Moment) -> Tensor:
        """Return the lift of a flow that stays attached, (..., 6)."""
        u, v, w = moment.nu_r[..., :3].unbind(-1)
        side, up = u * v, u * w
        a, b, c, d = self.theta.to(moment.nu).unbind(-1)
        none = torch.zeros_like(side)
        return torch.stack([none, a * side, b * up, none, c * up, d * side], dim=-1)
