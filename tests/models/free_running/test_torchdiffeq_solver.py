"""torchdiffeq as an independent check on the own integrator, and how its ways of failing are met."""

from __future__ import annotations

import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.models.free_running import torchdiffeq_solver
from auvnn.testing import make_scene

DOUBLE = torch.float64


@pytest.mark.parametrize("effects", [[], ["ocean_current", "cg_offset"], ["thruster_lag", "thruster_gain"]])
def test_own_and_foreign_integrator_agree(example, bank, effects):
    values = {"ocean_current": {"v_north": 0.2, "v_east": -0.1}, "cg_offset": {"x": 0.02},
              "thruster_lag": {"time_constant": 0.15}, "thruster_gain": {"thruster_1": 0.8}}  # fmt: skip
    model = GreyBox(example.vehicle, damping=bank).with_effects({n: values[n] for n in effects})
    scene = make_scene(example.vehicle, "thrusters", runs=2, rows=4, warmup=2)
    with torch.no_grad():

        def go(**options):
            return model.rollout(scene.eta, scene.nu, scene.inputs, scene.times, warmup=2, **options)

        own = go(max_step=0.001)
        foreign = go(solver="torchdiffeq:dopri5", rtol=1e-10, atol=1e-11)
    torch.testing.assert_close(own.nu, foreign.nu, rtol=0, atol=1e-8)
    torch.testing.assert_close(own.eta, foreign.eta, rtol=0, atol=1e-8)


def test_fixed_methods_step_once_per_interval(rov, forced):
    """torchdiffeq's rk4 is Kutta's 3/8 rule: another method of the same order."""
    eta, nu, wrench = forced
    times = torch.linspace(0, 0.6, 61, dtype=DOUBLE)
    commands = wrench.expand(61, 6)
    with torch.no_grad():
        own = rov.rollout(eta, nu, commands, times)
        for method, tolerance in (("rk4", 1e-8), ("midpoint", 1e-4), ("euler", 1e-2)):
            foreign = rov.rollout(eta, nu, commands, times, solver=f"torchdiffeq:{method}")
            torch.testing.assert_close(own.nu, foreign.nu, rtol=0, atol=tolerance)
        same = rov.rollout(eta, nu, commands, times, solver="midpoint")
        foreign = rov.rollout(eta, nu, commands, times, solver="torchdiffeq:midpoint")
    torch.testing.assert_close(same.nu, foreign.nu, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", torchdiffeq_solver.ADAPTIVE)
def test_every_adaptive_method_reaches_its_tolerance(rov, forced, method):
    eta, nu, wrench = forced
    times = torch.tensor([0.0, 0.1], dtype=DOUBLE)
    loose = {"rtol": 1e-5, "atol": 1e-6}
    with torch.no_grad():
        own = rov.rollout(eta, nu, wrench.expand(2, 6), times, max_step=0.005)
        foreign = rov.rollout(eta, nu, wrench.expand(2, 6), times, solver=f"torchdiffeq:{method}", **loose)
    torch.testing.assert_close(own.nu, foreign.nu, rtol=0, atol=1e-3)


def test_history_before_the_stretch_counts(rov, forced):
    eta, nu, wrench = forced
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.2}})
    times = torch.arange(5, dtype=DOUBLE) * 0.1
    commands = torch.stack([0 * wrench, wrench, -wrench, wrench, wrench])
    with torch.no_grad():
        own = model.rollout(eta, nu, commands, times, warmup=2, max_step=0.002)
        foreign = model.rollout(eta, nu, commands, times, warmup=2, solver="torchdiffeq:dopri5")
    torch.testing.assert_close(own.nu, foreign.nu, rtol=0, atol=1e-6)


def test_gradients_flow_through(rov, forced):
    eta, nu, wrench = forced
    model = rov.with_effects({"net_buoyancy": {"force": 4.0}})
    times = torch.tensor([0.0, 0.1, 0.2], dtype=DOUBLE)
    slopes = []
    for options in ({"max_step": 0.01}, {"solver": "torchdiffeq:dopri5"}):
        end = model.rollout(eta, nu, wrench.expand(3, 6), times, **options).nu[-1].sum()
        slopes.append(torch.autograd.grad(end, model.effects[0].theta)[0])
    torch.testing.assert_close(slopes[0], slopes[1], rtol=1e-6, atol=0)


def test_times_that_differ_by_trajectory_are_refused(rov, forced):
    eta, nu, wrench = forced
    times = torch.arange(3, dtype=DOUBLE).expand(2, 3) * 0.1
    with pytest.raises(ConfigError, match="one time axis for all trajectories: use solver=rk4"):
        rov.rollout(eta, nu, wrench.expand(2, 3, 6), times, solver="torchdiffeq:dopri5")


@pytest.mark.parametrize("tolerance", [{"rtol": 0.0}, {"atol": -1.0}])
def test_tolerances_must_be_positive(rov, forced, tolerance):
    eta, nu, wrench = forced
    with pytest.raises(ConfigError, match="give a positive tolerance"):
        rov.rollout(
            eta, nu, wrench.expand(2, 6), torch.tensor([0, 0.1]), solver="torchdiffeq:dopri5", **tolerance
        )


def test_the_budget_of_evaluations_ends_a_hopeless_run(rov, forced, monkeypatch):
    eta, nu, wrench = forced
    monkeypatch.setattr(torchdiffeq_solver, "MAX_EVALUATIONS", 50)
    with pytest.raises(ConfigError, match="gave up at t = 0 s after 50 evaluations: loosen rtol and atol"):
        rov.rollout(eta, nu, wrench.expand(2, 6), torch.tensor([0.0, 5.0], dtype=DOUBLE),
                    solver="torchdiffeq:bosh3", rtol=1e-12, atol=1e-13)  # fmt: skip


def test_a_command_that_is_no_number_costs_no_more_than_any_other(rov, forced, monkeypatch):
    """Adaptive methods would shrink their step for ever; their guard is an assertion, gone under `-O`."""
    eta, nu, wrench = forced
    calls = []
    original = GreyBox.nu_dot
    monkeypatch.setattr(
        GreyBox, "nu_dot", lambda self, *a, **k: (calls.append(1), original(self, *a, **k))[1]
    )
    times, counts = torch.arange(4, dtype=DOUBLE) * 0.1, []
    for value in (1.0, torch.nan):
        commands = wrench.repeat(4, 1)
        commands[1, 0] = value
        calls.clear()
        with torch.no_grad():
            run = rov.rollout(eta, nu, commands, times, solver="torchdiffeq:dopri5")
        counts.append(len(calls))
    assert run.diverged and counts[1] <= 2 * counts[0]
