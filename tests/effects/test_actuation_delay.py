"""Actuation delay: against a free mass under a delayed force, in closed form, and with a lag behind it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

TIMES = torch.tensor([0.0, 0.1, 0.25, 0.3, 0.7, 0.75, 1.5], dtype=torch.float64)
FORCE, MASS = 10.0, 70.0


def after_step(model, before=1.0, **options):
    """Run through a long pause and then a constant force; return what happens from the force on."""
    rows = torch.cat([torch.tensor([-before], dtype=torch.float64), TIMES])
    commands = torch.zeros(len(rows), 6, dtype=torch.float64)
    commands[1:, 0] = FORCE
    zero = torch.zeros(6, dtype=torch.float64)
    return model.rollout(zero, zero, commands, rows, warmup=1, **options)


@pytest.mark.parametrize("delay", [0.003, 0.1, 0.27, 0.9])
@pytest.mark.parametrize("options", [{}, {"max_step": 1.0}, {"solver": "torchdiffeq:dopri5"}])
def test_a_free_mass_starts_so_much_later(plain, delay, options):
    """u = F/m (t - d), x = F/2m (t - d)^2 from t = d on, though d falls inside the intervals."""
    run = after_step(plain({"actuation_delay": {"delay": delay}}), **options)
    for t, eta, nu in zip(TIMES.tolist(), run.eta, run.nu, strict=True):
        since = max(t - delay, 0.0)
        assert nu[0].item() == pytest.approx(FORCE / MASS * since, abs=1e-9)
        assert eta[0].item() == pytest.approx(FORCE / MASS * since**2 / 2, abs=1e-9)


def test_the_delayed_thrust_is_the_one_commanded_then(plain):
    run = after_step(plain({"actuation_delay": {"delay": 0.26}}))
    assert run.thrust[:, 0].tolist() == [FORCE if t >= 0.26 else 0.0 for t in TIMES.tolist()]


@pytest.mark.parametrize("options", [{}, {"max_step": 1.0}])
def test_a_lag_behind_the_delay_is_followed_exactly(plain, options):
    """With s = t - d and e = 1 - exp(-s/tau): u = F/m (s - tau e)."""
    delay, tau = 0.17, 0.2
    effects = {"actuation_delay": {"delay": delay}, "thruster_lag": {"time_constant": tau}}
    run = after_step(plain(effects), **options)
    for t, nu, thrust in zip(TIMES.tolist(), run.nu, run.thrust, strict=True):
        s = max(t - delay, 0.0)
        e = 1 - math.exp(-s / tau)
        assert nu[0].item() == pytest.approx(FORCE / MASS * (s - tau * e), abs=1e-12)
        assert thrust[0].item() == pytest.approx(FORCE * e, abs=1e-12)


def test_uneven_commands_give_what_a_solver_with_the_delayed_command_gives(plain):
    """Scipy integrates a drag-ridden mass under the looked-up delayed command."""
    random = np.random.default_rng(0)
    times = np.cumsum(random.uniform(0.02, 0.12, 40))
    force, delay = random.normal(size=40) * 20, 0.137
    edges = np.unique(np.concatenate([times, times + delay]))
    drag = 30.0

    def rate(t, y):
        k = max(int(np.searchsorted(times, t - delay, side="right")) - 1, 0)
        return [y[1], (force[k] - drag * abs(y[1]) * y[1]) / MASS]

    y, place = np.zeros(2), []
    for a, b in itertools.pairwise(edges):
        if b > times[-1] + 1e-12:
            break
        middle = 0.5 * (a + b)
        y = solve_ivp(lambda t, y, m=middle: rate(m, y), (a, b), y, rtol=1e-11, atol=1e-12).y[:, -1]
        place.append((b, *y))
    model = plain({"actuation_delay": {"delay": delay}}, quadratic_damping=[drag, 30, 30, 1, 1, 1])
    commands = torch.zeros(40, 6, dtype=torch.float64)
    commands[:, 0] = torch.tensor(force)
    zero = torch.zeros(6, dtype=torch.float64)
    run = model.rollout(zero, zero, commands, torch.tensor(times), max_step=0.01)
    b, x, u = place[-1]
    assert b == pytest.approx(times[-1])
    assert run.eta[-1, 0].item() == pytest.approx(x, abs=2e-6)
    assert run.nu[-1, 0].item() == pytest.approx(u, abs=2e-6)


def test_the_slope_at_the_null_is_that_of_a_short_delay(plain):
    """The speed after a step of command, F/m (t - d), loses F/m per second of delay."""
    model = plain({"actuation_delay": None})
    speed = after_step(model).nu[-1, 0]
    (slope,) = torch.autograd.grad(speed, model.effects[0].theta)
    assert slope.item() == pytest.approx(-FORCE / MASS, 1e-12)


def test_a_window_padded_with_its_last_row_is_that_window(plain):
    """Rows repeated at an unchanged time, as shorter windows have them, are no motion and no fault."""
    model = plain({"actuation_delay": {"delay": 0.13}, "thruster_lag": {"time_constant": 0.1}})
    times = torch.tensor([0.0, 0.1, 0.2, 0.3, 0.3, 0.3], dtype=torch.float64)
    commands = torch.zeros(6, 6, dtype=torch.float64)
    commands[1:, 0] = FORCE
    zero = torch.zeros(6, dtype=torch.float64)
    padded = model.rollout(zero, zero, commands, times).nu
    whole = model.rollout(zero, zero, commands[:4], times[:4]).nu
    torch.testing.assert_close(padded[:4], whole, rtol=1e-12, atol=1e-15)
    torch.testing.assert_close(padded[4:], whole[3:].expand(2, 6), rtol=1e-12, atol=1e-15)
