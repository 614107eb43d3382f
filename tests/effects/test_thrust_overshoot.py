"""Thrust overshoot: against the exponential after a step, a first-order ODE solved by scipy, and a plain lag."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle


def overshoot(excess, tau):
    model = GreyBox(plain_vehicle(), actuation="wrench").with_effects(
        {"thrust_overshoot": {"time_constant": tau, "X": excess}}
    )
    return model.effects[0]


def test_after_a_step_the_excess_fades_exponentially():
    """Mean over row k of 1 + kappa exp(-t/tau)."""
    t = np.array([0.0, 0.1, 0.15, 0.4, 1.0, 1.7, 3.0])
    command = np.zeros((7, 6))
    command[1:, 0] = 10.0
    found = overshoot(0.8, 0.5).command(torch.tensor(command), torch.tensor(t))[:, 0].detach().numpy()
    fading = 0.5 * (np.exp(-(t[1:-1] - 0.1) / 0.5) - np.exp(-(t[2:] - 0.1) / 0.5)) / np.diff(t[1:])
    np.testing.assert_allclose(found[1:-1], 10 * (1 + 0.8 * fading), rtol=1e-12)
    assert found[0] == 0.0


@pytest.mark.parametrize("tau", [0.05, 0.7, 30.0])
def test_a_long_uneven_record_against_the_differential_equation(tau):
    """Longer than several chunks of the filter; the flow's state row by row from scipy's solver."""
    random = np.random.default_rng(0)
    t = np.cumsum(random.uniform(0.02, 0.3, 400))
    command = np.repeat(random.normal(size=(50, 1)), 8, axis=0)
    state, expected = command[0, 0], []
    for k in range(399):
        h, c = t[k + 1] - t[k], command[k, 0]
        run = solve_ivp(
            lambda _, y, c=c: [(c - y[0]) / tau, y[0]], (0, h), [state, 0.0], rtol=1e-10, atol=1e-12
        )
        expected.append(c + 2.0 * (c - run.y[1, -1] / h))
        state = run.y[0, -1]
    command = np.pad(command, ((0, 0), (0, 5)))
    found = overshoot(2.0, tau).command(torch.tensor(command), torch.tensor(t))
    np.testing.assert_allclose(found[:-1, 0].detach().numpy(), expected, atol=1e-7)


def test_an_excess_of_minus_one_moves_a_free_mass_like_a_plain_lag(plain, still):
    """Same impulse in every row, so the same speed at every row's end."""
    times = torch.arange(40, dtype=torch.float64) * 0.1
    commands = torch.zeros(40, 6, dtype=torch.float64)
    commands[5:, 0], commands[20:, 0] = 10.0, -4.0
    speeds = [
        plain({name: values}).rollout(still, still, commands, times).nu[:, 0].detach()
        for name, values in (
            ("thrust_overshoot", {"X": -1.0, "time_constant": 0.3}),
            ("thruster_lag", {"time_constant": 0.3}),
        )
    ]
    torch.testing.assert_close(speeds[0], speeds[1], atol=1e-12, rtol=0)
