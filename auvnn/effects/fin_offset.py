"""Fins that stand at another angle than the log says."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Body, Moment, Parameter
from auvnn.effects.fin_parts import FinEffect, fin_names


class FinOffset(FinEffect):
    """One angle per fin that is added to the commanded one: a linkage that was set wrong, or a bent fin.

    In proportion to the dynamic pressure, which tells it from a constant moment.
    Reference: Prestero (2001), control fin forces and moments.
    """

    name = "fin_offset"
    cause = "a fin stands at another angle than commanded"
    symbol = "delta_0"
    reference = "Prestero (2001), Verification of a six-degree of freedom simulation model, section 4.5"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one angle per fin; two or three degrees are plausible."""
        return tuple(Parameter(n, "rad", 0.0, 0.05, -0.5, 0.5) for n in fin_names(vehicle))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the lift at the true angles less that at the stated ones."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        angles = self.angles(moment)
        return self.lift(moment, angles + self.theta.to(moment.nu)) - self.lift(moment, angles)
