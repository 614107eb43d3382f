"""Lift of the hull that falls off at large angles to the flow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Body, Effect, Moment, Parameter


class BodyLiftStall(Effect):
    """The lift of `body_lift` fades as the hull turns across the flow: L <- (1 - s (1 - u^2 / V^2)) L, V = |v_r|.

    A lift in u v and u w grows up to 45 degrees, sin(a) cos(a) at an angle a. Measured bodies lose it earlier: the flow
    leaves the lee side. Jorgensen's potential term has a further factor cos(a/2), which is s = 0.13 at small angles and
    0.29 across the flow; with s = 1 the lift goes as sin(a) cos(a)^3 and is largest at 30 degrees. It acts where the
    model has a body lift, and nowhere else.
    Reference: Jorgensen (1977), NASA TR R-474; Hoerner and Borst (1985), Fluid-Dynamic Lift, chapter 19.
    """

    name = "body_lift_stall"
    cause = "the hull's lift falls off at large angles to the flow"
    symbol = "s_L"
    reference = "Jorgensen (1977), NASA TR R-474"
    acts_with = ("body_lift",)
    confused_with = ("fin_stall", "turning_forces", "coupled_damping")
    manoeuvre = "oblique"
    told_apart_by = "steady speed at angles of drift and attack from small to beyond 30 degrees"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the share that is lost across the flow; a half is as plausible as all of it."""
        return (Parameter("share", "1", 0.0, 0.5, -1.0, 2.0),)

    def onward(self, moment: Moment) -> Moment:
        """Return the moment in which a lift that comes later fades."""
        return replace(moment, lift_lost=self._lost(moment))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what a lift that came before loses; what comes later is told by `onward`."""
        if moment.body_lift is None:
            return torch.zeros_like(moment.nu)
        return -self._lost(moment).unsqueeze(-1) * moment.body_lift

    def _lost(self, moment: Moment) -> Tensor:
        """Return the share of the lift that is lost, (...)."""
        squares = moment.nu_r[..., :3].square()
        across = squares[..., 1] + squares[..., 2]
        return self.theta[0].to(across) * across / (squares[..., 0] + across + 1e-30)
