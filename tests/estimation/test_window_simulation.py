"""Thrust over windows: its mean in an interval is that of a lag in closed form, into however many steps it is divided."""

from __future__ import annotations

import pytest
import torch

from auvnn.estimation.window_simulation import Thrust
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

TAU = 0.12


@pytest.fixture(scope="module")
def lagged():
    """Windows of a log, and a model whose thrust lags."""
    plain = GreyBox(small_vehicle())
    windows = cut_windows(make_log(plain, runs=1, duration=6.0, noise=1.0), 2.0)
    return plain.with_effects({"thruster_lag": {"time_constant": TAU}}), plain, windows


@pytest.mark.parametrize("substeps", [1, 2, 5])
def test_mean_and_beginning_are_those_of_an_exponential(lagged, substeps):
    model, plain, windows = lagged
    with torch.no_grad():
        mean, start = Thrust(model)(windows, substeps)
        demand = plain.actuators.drive(windows.inputs.command, windows.times, [], 1).means[..., 0, :]
    assert mean.shape == start.shape == demand[:, windows.warmup :].shape
    state, steps = demand[:, 0], windows.times[:, 1:] - windows.times[:, :-1]
    for k in range(demand.shape[1] - 1):
        gap, h = state - demand[:, k], steps[:, k, None]
        if k >= windows.warmup:
            own = k - windows.warmup
            torch.testing.assert_close(start[:, own], state, rtol=1e-12, atol=1e-12)
            closed = demand[:, k] + gap * TAU / h * -torch.expm1(-h / TAU)
            torch.testing.assert_close(mean[:, own], closed, rtol=1e-11, atol=1e-11)
        state = demand[:, k] + gap * torch.exp(-h / TAU)
    # A mean is not what an interval begins with.
    assert float((mean - start).abs().max()) > 1.0
