"""Thrust that follows its demand with a first-order lag."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.first_order import TIME_CONSTANT, first_order
from auvnn.effects.hooks import Parameter, Response


class ThrusterLag(Effect):
    """First-order lag between demanded and actual thrust: dT/dt = (T_demand - T) / time_constant.

    Over an interval of constant demand the solution is exact, T = T_d + (T_0 - T_d) exp(-t/tau). Its mean and
    first moment over a step h are taken in closed form, so that a time constant far below the step neither
    makes the integration stiff nor gets lost, and the slope at the null (tau = 0) is the true one.
    Reference: Yoerger, Cooke and Slotine (1990).
    """

    name = "thruster_lag"
    cause = "the thrust follows its demand with a lag"
    symbol = "tau_T"
    reference = "Yoerger, Cooke and Slotine (1990), IEEE JOE 15(3)"
    confused_with = ("actuation_delay", "propeller_lag", "added_mass", "thrust_overshoot")
    manoeuvre = "chirp"
    told_apart_by = "steps and swept sines"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the time constant."""
        return (TIME_CONSTANT,)

    def respond(self, state: Tensor, demand: Tensor, step: Tensor) -> Response:
        """Return the lagged thrust; at the null it is the demand itself, exactly."""
        return first_order(self.theta[0], state, demand, step)
