"""Fins that stand at another angle than the log says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from auvnn.effects.base import Parameter
from auvnn.effects.fin_parts import LiftEffect, fin_names
from auvnn.effects.hooks import FinLift


class FinOffset(LiftEffect):
    """One angle per fin that is added to the commanded one: a linkage that was set wrong, or a bent fin.

    In proportion to the dynamic pressure, which tells it from a constant moment.
    Reference: Prestero (2001), control fin forces and moments.
    """

    name = "fin_offset"
    cause = "a fin stands at another angle than commanded"
    symbol = "delta_0"
    reference = "Prestero (2001), Verification of a six-degree of freedom simulation model, section 4.5"
    confused_with = ("cg_offset", "constant_force", "fin_gain")
    manoeuvre = "survey"
    told_apart_by = "straight legs at several speeds"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one angle per fin; two or three degrees are plausible."""
        return tuple(Parameter(n, "rad", 0.0, 0.05, -0.5, 0.5) for n in fin_names(vehicle))

    def changed(self, lift: FinLift) -> FinLift:
        """Return the lift at the true angles."""
        return replace(lift, angles=lift.angles + self.theta.to(lift.angles))
