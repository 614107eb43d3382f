"""Fins that give more or less lift than the model says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Body, Moment, Parameter
from auvnn.effects.fin_parts import LiftEffect, fin_names
from auvnn.effects.hooks import FinLift


class FinGain(LiftEffect):
    """One factor per fin on its lift: F <- k F, at every angle and in every flow.

    A fin that is smaller or larger than stated, in the hull's wake, or broken off (k = 0).
    Reference: Prestero (2001), control fin forces and moments.
    """

    name = "fin_gain"
    cause = "a fin gives more or less lift than it should"
    symbol = "k_delta"
    reference = "Prestero (2001), Verification of a six-degree of freedom simulation model, section 4.5"
    confused_with = ("fin_offset", "body_lift", "fin_stall", "fin_lag")
    manoeuvre = "survey"
    told_apart_by = (
        "turns and depth changes at several speeds: the fins' force grows with the square of the speed"
    )

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one factor per fin."""
        return tuple(Parameter(n, "1", 1.0, 0.2, -2.0, 5.0) for n in fin_names(vehicle))

    def changed(self, lift: FinLift) -> FinLift:
        """Return the lift with each fin's factor."""
        return replace(lift, share=lift.share * self.theta.to(lift.angles))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what the lift with the factors has more than without them."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        now = self.now(moment)
        return self.lift(moment, replace(now, share=now.share * (self.theta.to(moment.nu) - 1.0)))
