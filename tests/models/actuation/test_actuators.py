"""From commands to thrust over time: curves, the lag's closed form, its history."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.models.actuation.actuators import Actuators
from auvnn.testing import example_vehicle
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64


def lag(tau, vehicle=None, actuation="wrench"):
    vehicle = vehicle or load_vehicle("rov95")
    return EFFECTS.get("thruster_lag").build(vehicle, actuation, {"time_constant": tau})


def test_static_thrust_follows_each_units_own_curve():
    vehicle = example_vehicle()
    actuators = Actuators(vehicle, "thrusters")
    command = torch.linspace(-1.2, 1.2, 25, dtype=DOUBLE).unsqueeze(-1).expand(25, 6)
    thrust = actuators.static(command).numpy()
    for k, unit in enumerate(vehicle.thrusters):
        c = command[:, k].numpy()
        if unit.curve == "quadratic":
            expected = np.where(c > 0, unit.max_forward, unit.max_reverse) * c * np.abs(c)
        else:
            expected = np.interp(c, unit.curve.command, unit.curve.thrust)
        np.testing.assert_allclose(thrust[:, k], expected, rtol=1e-14, atol=1e-14)


def test_tables_at_the_same_commands_stay_each_units_own():
    vehicle = load_vehicle("bluerov2_heavy")
    units = []
    for k, unit in enumerate(vehicle.thrusters):
        less, curve = 1.0 - 0.1 * (k % 3), unit.curve
        assert not isinstance(curve, str)
        most = {"max_forward": less * unit.max_forward, "max_reverse": less * unit.max_reverse}
        units.append(replace(unit, curve=replace(curve, thrust=less * curve.thrust), **most))
    command = torch.linspace(-1.1, 1.1, 40, dtype=DOUBLE).reshape(5, 8)
    thrust = Actuators(replace(vehicle, thrusters=tuple(units)), "thrusters").static(command).numpy()
    for k, unit in enumerate(units):
        expected = np.interp(command[:, k].numpy(), unit.curve.command, unit.curve.thrust)  # type: ignore[union-attr]
        np.testing.assert_allclose(thrust[:, k], expected, rtol=1e-13, atol=1e-13)


def test_a_commanded_wrench_is_its_own_thrust():
    actuators = Actuators(load_vehicle("rov95"), "wrench")
    wrench = torch.randn(4, 6, dtype=DOUBLE)
    assert torch.equal(actuators.static(wrench), wrench) and actuators.size == 6


def test_unknown_actuation_and_missing_thrusters_are_refused():
    vehicle = load_vehicle("rov95")
    with pytest.raises(ConfigError, match="actuation='jets' is unknown: choose thrusters or wrench"):
        GreyBox(vehicle, actuation="jets")
    with pytest.raises(ConfigError, match="rov95 has no thrusters in its model file: log tau_X"):
        GreyBox(replace(vehicle, thrusters=()), actuation="thrusters")


@pytest.mark.parametrize("tau", [1e-9, 1e-5, 1e-3, 0.03, 0.2, 5.0])
@pytest.mark.parametrize("substeps", [1, 3])
def test_mean_and_first_moment_equal_those_of_the_exact_lag(tau, substeps):
    """Against the exponential integrated numerically, step by step through several commands."""
    vehicle = load_vehicle("rov95")
    actuators = Actuators(vehicle, "wrench")
    random = np.random.default_rng(1)
    demand, times = random.uniform(-50, 50, (5, 6)), np.array([0.0, 0.1, 0.25, 0.3, 0.7])
    drive = actuators.drive(torch.tensor(demand), torch.tensor(times), [lag(tau)], substeps)
    state = demand[0]
    for k, length in enumerate(np.diff(times)):
        h = length / substeps
        for part in range(substeps):
            # Gauss-Legendre over the step, in pieces that follow the scale of the exponential.
            edges = np.unique(np.concatenate([[0.0], np.minimum(tau * np.geomspace(1e-3, 60, 60), h), [h]]))
            nodes, weights = np.polynomial.legendre.leggauss(8)
            s = (edges[:-1, None] + edges[1:, None]) / 2 + np.diff(edges)[:, None] / 2 * nodes
            w = np.diff(edges)[:, None] / 2 * weights
            decay = np.exp(-s / tau)
            mean = demand[k] + (state - demand[k]) * (w * decay).sum() / h
            moment = (state - demand[k]) * (w * decay * (s / h - 0.5)).sum() / h
            np.testing.assert_allclose(drive.mean[k][part].detach(), mean, rtol=0, atol=1e-10)
            # A straight line of rise b has the first moment b/12 about the middle of the step.
            np.testing.assert_allclose(drive.slope[k][part].detach() / 12, moment, rtol=0, atol=1e-10)
            state = demand[k] + (state - demand[k]) * np.exp(-h / tau)


@pytest.mark.parametrize("tau", [1e-6, 1e-3, 0.01, 0.1])
def test_a_run_with_a_lag_equals_a_finely_stepped_one(rov, forced, tau):
    """Also for a time constant far below the step, where an explicit method would blow up."""
    eta, nu, wrench = forced
    model = rov.with_effects({"thruster_lag": {"time_constant": tau}})
    commands = torch.stack([wrench, 0.2 * wrench, 1.3 * wrench, wrench])
    times = torch.tensor([0.0, 0.1, 0.2, 0.3], dtype=DOUBLE)
    with torch.no_grad():
        coarse = model.rollout(eta, nu, commands, times, max_step=0.05)
        fine = model.rollout(eta, nu, commands, times, max_step=0.002)
    assert not coarse.diverged
    torch.testing.assert_close(coarse.nu, fine.nu, rtol=0, atol=2e-5)
    torch.testing.assert_close(coarse.thrust, fine.thrust, rtol=1e-12, atol=1e-12)


def test_history_makes_the_actuators_forget_where_they_began(rov, forced):
    eta, nu, wrench = forced
    model, tau = rov.with_effects({"thruster_lag": {"time_constant": 0.1}}), 0.1
    times = torch.arange(16, dtype=DOUBLE) * 0.1
    commands = wrench.repeat(2, 16, 1) * torch.cos(7 * times).unsqueeze(-1)
    commands[1, 0] += 30.0  # another beginning; the rest of the history is the same
    for warmup in (1, 5, 10):
        with torch.no_grad():
            run = model.rollout(eta, nu, commands, times, warmup=warmup)
        assert run.nu.shape == (2, 16 - warmup, 6)
        difference = (run.thrust[1] - run.thrust[0])[0].abs().max().item()
        # Settled at the first row, it holds that command over the first interval, then forgets.
        assert difference == pytest.approx(30 * np.exp(-(warmup - 1) * 0.1 / tau), rel=1e-9)


def test_without_history_the_actuators_are_settled_at_the_first_command(rov, forced):
    eta, nu, wrench = forced
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.4}})
    times = torch.arange(4, dtype=DOUBLE) * 0.1
    with torch.no_grad():
        lagging = model.rollout(eta, nu, wrench.expand(4, 6), times)
        direct = rov.rollout(eta, nu, wrench.expand(4, 6), times)
    torch.testing.assert_close(lagging.nu, direct.nu, rtol=1e-13, atol=1e-14)


def test_two_effects_with_dynamics_of_the_actuators_are_refused(rov):
    class Slow(EFFECTS.get("thruster_lag")):
        name = "slow"

    model = GreyBox(rov.vehicle, [lag(0.1), Slow.build(rov.vehicle, "wrench")], actuation="wrench")
    zero = torch.zeros(6, dtype=DOUBLE)
    with pytest.raises(ConfigError, match="thruster_lag and slow both give the actuators dynamics"):
        model.rollout(zero, zero, zero.expand(2, 6), torch.tensor([0.0, 0.1], dtype=DOUBLE))


def test_an_effect_that_changes_commands_and_has_dynamics_acts_once(rov):
    class Halved(EFFECTS.get("thruster_lag")):
        name = "halved"

        def command(self, command, times):
            return 0.5 * command

    zero = torch.zeros(6, dtype=DOUBLE)
    model = GreyBox(rov.vehicle, [Halved.build(rov.vehicle, "wrench")], actuation="wrench")
    run = model.rollout(
        zero, zero, torch.full((2, 6), 8.0, dtype=DOUBLE), torch.tensor([0.0, 0.1], dtype=DOUBLE)
    )
    assert torch.equal(run.thrust, torch.full((2, 6), 4.0, dtype=DOUBLE))
    assert torch.equal(
        model(zero, zero, torch.full((6,), 8.0, dtype=DOUBLE)),
        rov(zero, zero, torch.full((6,), 4.0, dtype=DOUBLE)),
    )
