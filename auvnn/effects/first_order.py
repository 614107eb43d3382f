"""A first-order lag behind a demand that is constant over a step, solved exactly; no effect itself."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from auvnn.effects.hooks import EACH, Parameter, Response

TIME_CONSTANT = Parameter("time_constant", "s", 0.0, 0.15, 0.0, 5.0, timing=True, actuator=EACH)
"""Of lags that act on each actuator by itself."""

SMALL = 0.05
"""Step over time constant below which the power series holds to the last digits."""

SERIES = tuple(
    12 * (-1) ** n * ((n + 1) / math.factorial(n + 2) - 0.5 / math.factorial(n + 1)) for n in range(1, 7)
)


def first_order(tau: Tensor, state: Tensor, demand: Tensor, step: Tensor) -> Response:
    """Return how x goes under tau dx/dt = x_d - x from x_0; at tau = 0 it is the demand itself, exactly.

    x(t) = x_d + (x_0 - x_d) exp(-t/tau). With r = tau/h and E = exp(-1/r): mean x_d + (x_0 - x_d) r (1 - E), and a
    straight line's rise of 12 (x_0 - x_d) [r^2 (1 - E (1 + 1/r)) - r (1 - E)/2] for the first moment; where r is large
    these differences would lose all digits, so the rise is taken from its power series in 1/r there. The slope in
    tau at zero is the true one.

    Args:
        tau: time constant, s, a scalar, not negative.
        state: x at the start, (..., n).
        demand: what it goes towards, (..., n).
        step: for how long, s, broadcast against both.
    """
    tau = tau.to(demand)
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


def row_lengths(times: Tensor) -> Tensor:
    """Return for how long the command of each row is held, s, (..., T, 1).

    The last row has no known length: as long as the one before, as if the record went on; zero where it is the only one.

    Args:
        times: of the rows, s, (..., T).
    """
    steps = (times[..., 1:] - times[..., :-1]).unsqueeze(-1)
    last = steps[..., -1:, :] if steps.shape[-2] else torch.zeros_like(times[..., :1].unsqueeze(-1))
    return torch.cat([steps, last], dim=-2)
