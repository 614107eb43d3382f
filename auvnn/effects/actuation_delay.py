"""Thrust that comes a fixed time after its command."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import EACH, Parameter


class ActuationDelay(Effect):
    """Pure delay of all thrust: T(t) = T_demand(t - delay); fins are where they are commanded.

    Commands are held between rows, so the delayed thrust jumps inside an interval unless the delay is a
    multiple of it; its average over each step is taken exactly, which also makes it differentiable.
    Reference: Fossen (2011), section 9; Ljung (1999), System Identification, section 4.2, for delays.
    """

    name = "actuation_delay"
    cause = "the thrust comes a fixed time after its command"
    symbol = "T_d"
    reference = "Ljung (1999), System Identification, section 4.2"
    confused_with = ("thruster_lag", "propeller_lag", "added_mass", "fin_lag")
    manoeuvre = "chirp"
    told_apart_by = "steps and swept sines"
    plainer = ("thruster_lag",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the delay."""
        return (Parameter("delay", "s", 0.0, 0.1, 0.0, 2.0, timing=True, actuator=EACH),)

    def delay(self) -> Tensor:
        """Return the delay."""
        return self.theta[0]
