"""Fins that stall earlier or later than the model says."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Body, Moment, Parameter
from auvnn.effects.fin_parts import FinEffect


class FinStall(FinEffect):
    """Factor on the angle at which all fins stall; the wrench is the difference that it makes.

    Reference: Beard and McLain (2012), section 4.2, for the lift beyond the stall.
    """

    name = "fin_stall"
    cause = "the fins stall at another angle"
    symbol = "alpha_0"
    reference = "Beard and McLain (2012), Small Unmanned Aircraft, section 4.2"
    confused_with = ("body_lift",)
    manoeuvre = "survey"
    told_apart_by = "large fin angles at constant speed"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factor."""
        return (Parameter("factor", "1", 1.0, 0.3, 0.2, 4.0),)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the lift with the other stall less the lift with the stated one."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        angles = self.angles(moment)
        later = self.kept("stall").to(moment.nu) * self.theta[0].to(moment.nu)
        return self.lift(moment, angles, stall=later) - self.lift(moment, angles)
