"""Thrust that follows its demand with a first-order lag."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Response

SMALL = 0.05
"""Step over time constant below which the power series holds to the last digits."""

SERIES = tuple(
    12 * (-1) ** n * ((n + 1) / math.factorial(n + 2) - 0.5 / math.factorial(n + 1)) for n in range(1, 7)
)


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
    confused_with = ("actuation_delay", "added_mass", "thrust_overshoot")
    manoeuvre = "chirp"
    told_apart_by = "steps and swept sines"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the time constant."""
        return (Parameter("time_constant", "s", 0.0, 0.15, 0.0, 5.0),)

    def respond(self, state: Tensor, demand: Tensor, step: Tensor) -> Response:
        """Return the lagged thrust; at the null it is the demand itself, exactly.

        With x = tau/h and E = exp(-1/x): mean T_d + (T_0 - T_d) x (1 - E), and a straight line's rise of
        12 (T_0 - T_d) [x^2 (1 - E (1 + 1/x)) - x (1 - E)/2] for the first moment; where x is large these
        differences would lose all digits, so the rise is taken from its power series in 1/x there.
        """
        tau = self.theta[0].to(demand)
        ratio = tau / torch.clamp(step, min=1e-9)
        # Below a thousandth of the step exp(-1/x) is zero to the last bit; its slope would be 0/0.
        slow = ratio > 1e-3
        inverse = 1.0 / torch.where(slow, ratio, torch.ones_like(ratio))
        left = torch.where(slow, torch.exp(-inverse), torch.zeros_like(ratio))
        inverse = torch.where(slow, inverse, torch.zeros_like(ratio))
        mean = ratio * -torch.expm1(-inverse)
        mean = torch.where(slow, mean, ratio)
        moment = 12 * (ratio * ratio * (1 - left * (1 + inverse)) - 0.5 * mean)
        small, series = torch.clamp(inverse, max=SMALL), 0.0
        for coefficient in reversed(SERIES):
            series = (series + coefficient) * small
        moment = torch.where(slow & (inverse < SMALL), series, moment)
        gap = state - demand
        start = torch.where(tau > 0, state, demand)
        return Response(demand + gap * left, demand + gap * mean, gap * moment, start)
