"""A lag of the propellers' speed: against a first-order ODE solved by scipy, closed forms, and the lag of the thrust."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from auvnn.effects import effect_class
from auvnn.models import GreyBox
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64


def lag(tau):
    model = GreyBox(load_vehicle("rov95"), actuation="thrusters")
    return model.with_effects({"propeller_lag": {"time_constant": tau}}).effects[0]


def driven(effects, command, times):
    """Return the mean thrust over every interval, (T, n)."""
    model = GreyBox(load_vehicle("rov95"), actuation="thrusters").with_effects(effects)
    with torch.no_grad():
        return model.actuators.drive(command, times, list(model.effects)).means.mean(-2)


@pytest.mark.parametrize("tau", [0.0, 0.004, 0.1, 0.7, 5.0])
def test_a_long_uneven_record_against_the_differential_equation(tau):
    """The mean speed of every row, the speed going on from row to row by scipy's solver."""
    random = np.random.default_rng(0)
    t = np.cumsum(random.uniform(0.02, 0.3, 120))
    command = np.repeat(random.uniform(-1, 1, size=(30, 8)), 4, axis=0)
    speed, expected = command[0, 2], []
    for k in range(119):
        h, c = t[k + 1] - t[k], command[k, 2]
        if tau == 0.0:
            expected.append(c)
            continue
        run = solve_ivp(
            lambda _, y, c=c: [(c - y[0]) / tau, y[0]],
            (0, h), [speed, 0.0], "LSODA", rtol=1e-11, atol=1e-13,
        )  # fmt: skip
        expected.append(run.y[1, -1] / h)
        speed = run.y[0, -1]
    found = lag(tau).command(torch.tensor(command), torch.tensor(t))[:-1, 2].detach().numpy()
    np.testing.assert_allclose(found, expected, atol=1e-8 if tau else 0.0)


def test_the_slope_at_the_null_is_the_step_of_the_command_over_the_interval():
    """d mean/d tau = -(c_k - c_(k-1)) / h where the lag is short beside the interval."""
    effect = lag(0.0)
    times = torch.tensor([0.0, 0.1, 0.3, 0.35], dtype=DOUBLE)
    command = torch.tensor([0.2, 0.7, -0.4, -0.4], dtype=DOUBLE).unsqueeze(-1).expand(4, 8)
    mean = effect.command(command, times)
    found = [torch.autograd.grad(row[0], effect.theta, retain_graph=True)[0] for row in mean]
    expected = -torch.tensor([0.0, 0.5 / 0.2, -1.1 / 0.05, 0.0], dtype=DOUBLE)
    torch.testing.assert_close(torch.cat(found), expected)


def test_after_a_step_from_rest_the_thrust_is_the_square_of_the_speed():
    """n = 1 - exp(-t/tau): the mean of n^2 over an interval in closed form, and the curve of the vehicle."""
    h, tau = 0.01, 0.25
    times = torch.arange(120, dtype=DOUBLE) * h
    command = torch.zeros(120, 8, dtype=DOUBLE)
    command[10:, 3] = 1.0
    found = driven({"propeller_lag": {"time_constant": tau}}, command, times)[:, 3]
    full = driven({}, command, times)[-1, 3]
    t = (times[10:-1] - times[10]).numpy()
    after = t + h
    mean = 1.0 + (
        2 * tau * (np.exp(-after / tau) - np.exp(-t / tau))
        - 0.5 * tau * (np.exp(-2 * after / tau) - np.exp(-2 * t / tau))
    ) / h  # fmt: skip
    np.testing.assert_allclose((found[10:-1] / full).numpy(), mean, atol=1.3e-4)
    # The mean speed of an interval is squared: what is missed is the variance, a twelfth of the square of its change.
    change = np.diff(1 - np.exp(-np.append(t, after[-1]) / tau))
    np.testing.assert_allclose(mean - (found[10:-1] / full).numpy(), change**2 / 12, rtol=2e-3)


def test_small_steps_about_a_speed_lag_as_the_thrust_does_and_large_ones_do_not():
    """T(n - tau dn/dt) = T - tau dT/dt: what is left of the difference falls with the square of the step."""
    times = torch.arange(100, dtype=DOUBLE) * 0.02
    off = []
    for size in (0.4, 0.1, 0.025):
        command = torch.full((100, 8), 0.5, dtype=DOUBLE)
        command[10:] += size
        both = [
            driven({name: {"time_constant": 0.2}}, command, times)
            for name in ("propeller_lag", "thruster_lag")
        ]
        off.append(float((both[0] - both[1]).abs().max() / (driven({}, command, times)[-1, 0])))
    assert off[0] > 0.04
    assert 6 < off[0] / off[1] < 16 and 12 < off[1] / off[2] < 17


def test_holding_a_command_step_by_step_is_the_whole_record():
    effect = lag(0.3)
    times = torch.tensor([0.0, 0.1, 0.15, 0.4, 1.0, 1.1], dtype=DOUBLE)
    command = torch.rand(6, 8, generator=torch.Generator().manual_seed(0), dtype=DOUBLE)
    with torch.no_grad():
        whole, state = effect.command(command, times), command[0]
        for k in range(5):
            now, _ = effect.follow(state, command[k])
            torch.testing.assert_close(now, state)
            mean, after = effect.advance(state, command[k], (times[k + 1] - times[k]).reshape(1))
            torch.testing.assert_close(mean, whole[k])
            # What is gone in a short step is what the rate says.
            _, soon = effect.advance(state, command[k], torch.full((1,), 1e-6, dtype=DOUBLE))
            torch.testing.assert_close(
                (soon - state) / 1e-6, effect.follow(state, command[k])[1], rtol=1e-5, atol=1e-8
            )
            state = after


def test_a_record_of_one_row_is_settled():
    command = torch.rand(1, 8, dtype=DOUBLE)
    with torch.no_grad():
        torch.testing.assert_close(lag(0.3).command(command, torch.zeros(1, dtype=DOUBLE)), command)


def test_a_commanded_wrench_has_no_propellers():
    kind, vehicle = effect_class("propeller_lag"), load_vehicle("rov95")
    assert kind.lacks(vehicle, "thrusters") == ()
    assert kind.lacks(vehicle, "wrench") == ("commands of thrusters",)
