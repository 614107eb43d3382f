"""Thruster lag: against the step response of a first-order system, and what it does to a free mass."""

from __future__ import annotations

import math

import pytest
import torch

TIMES = torch.tensor([0.0, 0.1, 0.25, 0.3, 0.7, 0.75, 1.5], dtype=torch.float64)
FORCE = 10.0


def step(model, times, before=1.0):
    """Run through a long pause and then a constant force; return what happens from the force on."""
    rows = torch.cat([torch.tensor([-before], dtype=torch.float64), times])
    commands = torch.zeros(len(rows), 6, dtype=torch.float64)
    commands[1:, 0] = FORCE
    zero = torch.zeros(6, dtype=torch.float64)
    return model.rollout(zero, zero, commands, rows, warmup=1)


@pytest.mark.parametrize("tau", [1e-4, 0.02, 0.3, 4.0])
def test_the_thrust_after_a_step_is_one_minus_exponential(plain, tau):
    run = step(plain({"thruster_lag": {"time_constant": tau}}), TIMES)
    for t, thrust in zip(TIMES.tolist(), run.thrust[:, 0].tolist(), strict=True):
        assert thrust == pytest.approx(FORCE * (1 - math.exp(-t / tau)), abs=1e-12)


@pytest.mark.parametrize("tau", [1e-4, 0.02, 0.3, 4.0])
def test_a_free_mass_gets_speed_and_place_of_the_exact_solution_at_any_step(plain, tau):
    """With e = 1 - exp(-t/tau): m u' = F e, u = F/m (t - tau e), x = F/m (t2/2 - tau t + tau2 e)."""
    run = step(plain({"thruster_lag": {"time_constant": tau}}), TIMES)
    for t, eta, nu in zip(TIMES.tolist(), run.eta, run.nu, strict=True):
        e = 1 - math.exp(-t / tau)
        assert nu[0].item() == pytest.approx(FORCE / 70 * (t - tau * e), abs=1e-13)
        assert eta[0].item() == pytest.approx(FORCE / 70 * (t * t / 2 - tau * t + tau * tau * e), abs=1e-13)


def test_without_lag_the_thrust_is_there_at_once(plain):
    assert step(plain({"thruster_lag": None}), TIMES).thrust[:, 0].tolist() == [FORCE] * len(TIMES)


def test_the_settled_model_does_not_know_the_lag(plain, level, still, vector):
    command = vector(10, 0, 0, 0, 0, 1)
    lagging = plain({"thruster_lag": {"time_constant": 0.5}})
    assert torch.equal(lagging(level, still, command), plain()(level, still, command))


def test_the_slope_at_the_null_is_that_of_a_short_lag(plain):
    """The speed after a step of command, F/m (t - tau e), loses F/m per second of time constant."""
    model = plain({"thruster_lag": None})
    speed = step(model, TIMES).nu[-1, 0]
    (slope,) = torch.autograd.grad(speed, model.effects[0].theta)
    assert slope.item() == pytest.approx(-FORCE / 70, 1e-12)
