"""Fins that lag: against the step response of a first-order system, and along every way in which a model is run."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.compiled import toolchain
from auvnn.effects.fin_lag import FinLag
from auvnn.errors import ConfigError
from auvnn.exports.check import agreement
from auvnn.exports.system import System
from auvnn.models import GreyBox, Inputs, load
from auvnn.models import engine as engines
from auvnn.models.linear.state_space import StateSpace
from auvnn.plants import PLANTS, PlantTask
from auvnn.testing import plain_vehicle

DOUBLE = torch.float64
TIMES = torch.tensor([0.0, 0.1, 0.25, 0.3, 0.7, 0.75, 1.5], dtype=DOUBLE)
ANGLE = 0.12
LAG = {"fin_lag": {"time_constant": 0.2}}


@pytest.fixture(scope="module")
def compiler():
    if not toolchain.compiler():
        pytest.skip("no C compiler")


@pytest.fixture(scope="module")
def remus() -> GreyBox:
    return load("remus100")


def turning(model, rows=40, dt=0.05, seed=3, batch=()):
    """Return start, inputs and times of a vehicle at speed whose fins jump about."""
    generator = torch.Generator().manual_seed(seed)
    eta = torch.zeros(*batch, 7, dtype=DOUBLE)
    eta[..., 2], eta[..., 3] = 5.0, 1.0
    nu = torch.zeros(*batch, 6, dtype=DOUBLE)
    nu[..., 0] = 1.5
    command = torch.full((*batch, rows, model.actuators.size), 0.5, dtype=DOUBLE)
    angles = 0.2 * torch.rand(*batch, rows // 5 + 1, 4, generator=generator, dtype=DOUBLE) - 0.1
    fins = angles.repeat_interleave(5, dim=-2)[..., :rows, :]
    return eta, nu, Inputs(command, fins), dt * torch.arange(rows, dtype=DOUBLE)


@pytest.mark.parametrize("tau", [1e-4, 0.02, 0.3, 4.0])
def test_the_angle_after_a_step_is_one_minus_exponential(remus, tau):
    model = remus.with_effects({"fin_lag": {"time_constant": tau}})
    eta, nu, _, _ = turning(model)
    times = torch.cat([torch.tensor([-1.0], dtype=DOUBLE), TIMES])
    fins = torch.full((len(times), 4), ANGLE, dtype=DOUBLE)
    fins[0] = 0.0
    command = torch.full((len(times), model.actuators.size), 0.5, dtype=DOUBLE)
    run = model.rollout(eta, nu, Inputs(command, fins), times, warmup=1)
    for t, angles in zip(TIMES.tolist(), run.fins, strict=True):
        assert angles.tolist() == pytest.approx([ANGLE * (1 - math.exp(-t / tau))] * 4, abs=1e-12)
    assert run.thrust.shape[-1] == model.actuators.size


def test_rows_so_short_that_the_angle_is_constant_in_each_give_the_same(remus):
    """The angle as an input, worked out by hand, in a model without the lag."""
    model = remus.with_effects(LAG)
    eta, nu, inputs, times = turning(model, rows=16)
    found = model.rollout(eta, nu, inputs, times, max_step=0.025)
    fine = 40
    t = torch.linspace(0.0, float(times[-1]), fine * (len(times) - 1) + 1, dtype=DOUBLE)
    wanted, angle, out = inputs.fins, inputs.fins[0], []
    for k in range(len(t)):
        command = wanted[min(k // fine, len(times) - 1)]
        # Half-way through the short row.
        half = math.exp(-0.5 * float(t[1]) / 0.2)
        out.append(command + (angle - command) * half)
        angle = command + (angle - command) * half * half
    held = Inputs(
        torch.full((len(t), 1), 0.5, dtype=DOUBLE).expand(-1, model.actuators.size), torch.stack(out)
    )
    expected = remus.rollout(eta, nu, held, t, engine="torch")
    straight = remus.rollout(eta, nu, inputs, times, max_step=0.025)
    away = (found.nu - expected.nu[::fine]).abs().max()
    assert away < 1e-3 * (straight.nu - expected.nu[::fine]).abs().max()
    assert away < 2e-5


def test_every_way_of_running_agrees(remus, compiler):
    model = remus.with_effects(
        LAG | {"actuation_delay": {"delay": 0.07}, "thruster_lag": {"time_constant": 0.1}}
    )
    eta, nu, inputs, times = turning(model, batch=(3,))
    plain, machine = (
        model.rollout(eta, nu, inputs, times, max_step=0.025, engine=e) for e in ("torch", "compiled")
    )
    torch.testing.assert_close(machine.nu, plain.nu, rtol=1e-12, atol=1e-13)
    solved = model.rollout(eta, nu, inputs, times, solver="torchdiffeq:dopri5", rtol=1e-9, atol=1e-11)
    torch.testing.assert_close(solved.nu, plain.nu, rtol=0, atol=2e-5)
    # The torch engine's step for step: linearise and estimators walk with it.
    only = remus.with_effects(LAG)
    run = only.rollout(eta, nu, inputs, times, max_step=0.025)
    space = StateSpace(only, 0.05)
    x = space.settled(eta, nu, inputs.command[:, 0], inputs.fins[:, 0])
    assert space.state_names()[-4:] == [f"angle.fin_{k}" for k in (1, 2, 3, 4)]
    for k in range(len(times) - 1):
        u = space.join(inputs.command[:, k], inputs.fins[:, k], None, None)
        x = space.step(x, u, times[k].expand(3), torch.full((3,), 0.05, dtype=DOUBLE), 2)
    torch.testing.assert_close(x[:, 7:13], run.nu[:, -1], rtol=1e-11, atol=1e-12)


def test_compiled_gradients_are_those_of_torch_at_the_null_too(remus, compiler):
    for tau in (0.0, 0.2):
        model = remus.with_effects({"fin_lag": {"time_constant": tau}})
        eta, nu, inputs, times = turning(model)
        slopes = [
            torch.autograd.grad(
                model.rollout(eta, nu, inputs, times, engine=e, check=False).nu.square().sum(),
                model.effect("fin_lag").theta,
            )[0].item()
            for e in ("torch", "compiled")
        ]
        assert slopes[1] == pytest.approx(slopes[0], rel=1e-9)
        assert abs(slopes[0]) > 1e-3
    assert engines.why_not(model, inputs) == ""


def test_the_slope_at_the_null_is_that_of_a_short_lag(remus):
    def speed(tau):
        model = remus.with_effects({"fin_lag": {"time_constant": tau}})
        eta, nu, inputs, times = turning(model)
        return model, model.rollout(eta, nu, inputs, times, check=False, engine="torch").nu[-1, 5]

    model, at_null = speed(0.0)
    (slope,) = torch.autograd.grad(at_null, model.effect("fin_lag").theta)
    with torch.no_grad():
        # Forward differences of two lengths, and what they predict of none at all.
        coarse, fine = ((speed(h)[1] - at_null) / h for h in (2e-4, 1e-4))
    assert slope.item() == pytest.approx(float(2 * fine - coarse), rel=1e-4)


def test_a_window_that_begins_within_a_run_knows_the_angle_from_before(remus):
    model = remus.with_effects(LAG)
    eta, nu, inputs, times = turning(model)
    whole = model.rollout(eta, nu, inputs, times)
    part = model.rollout(whole.eta[22], whole.nu[22], inputs, times, warmup=22)
    torch.testing.assert_close(part.nu, whole.nu[22:], rtol=1e-12, atol=1e-13)
    unknown = model.rollout(whole.eta[22], whole.nu[22], inputs.rows(22), times[22:])
    assert (unknown.nu - whole.nu[22:]).abs().max() > 1e-4


@pytest.mark.parametrize("tau", [0.0, 0.2])
def test_the_independent_plant_and_the_own_stepper_move_alike(remus, tau):
    """Another formulation and another integrator, with the angle in continuous time."""
    effects = {"fin_lag": {"time_constant": tau}}
    model = remus.with_effects(effects)
    eta, nu, inputs, times = turning(model, batch=(2,))
    task = PlantTask(
        vehicle=remus.vehicle, actuation=remus.actuation, effects=effects, strangers={}, model=model,
        eta0=eta.numpy(), nu0=nu.numpy(), t=times.numpy(), command=inputs.command.numpy(), fins=inputs.fins.numpy(),
        voltage=None, bottom=None, max_step=0.01,
    )  # fmt: skip
    own, other = (PLANTS.get(n)().move(task, lambda k, *seen: seen) for n in ("own", "numpy"))
    np.testing.assert_allclose(own.nu, other.nu, atol=2e-6)
    np.testing.assert_allclose(own.nu_dot, other.nu_dot, atol=2e-5)
    np.testing.assert_array_equal(other.fins, inputs.fins.numpy())

    def controller(k, *seen):
        return inputs.command[:, k].numpy(), inputs.fins[:, k].numpy()

    stepped = PLANTS.get("own")().move(replace(task, controller=controller), lambda k, *seen: seen)
    np.testing.assert_allclose(stepped.nu, own.nu, atol=1e-10)
    np.testing.assert_allclose(stepped.nu_dot, own.nu_dot, atol=1e-8)


def test_exported_graphs_agree_with_the_model(remus):
    for effects in (LAG, LAG | {"thruster_lag": {"time_constant": 0.1}, "actuation_delay": {"delay": 0.12}}):
        found = agreement(System(remus.with_effects(effects), 0.05))
        assert max(found.values()) < 1e-9, found


def test_a_vehicle_without_fins_lacks_them_and_is_left_alone():
    vehicle = plain_vehicle()
    assert FinLag.lacks(vehicle, "wrench") == ("fins",)
    zero = torch.zeros(6, dtype=DOUBLE)
    push = torch.ones(5, 6, dtype=DOUBLE)
    bare = GreyBox(vehicle, actuation="wrench")
    runs = [m.rollout(zero, zero, push, torch.arange(5).double()) for m in (bare, bare.with_effects(LAG))]
    assert torch.equal(runs[0].nu, runs[1].nu) and runs[1].fins is None


def test_two_lags_of_the_fins_are_refused(remus):
    class Another(FinLag):
        name = "another_lag"

    effects = [k.build(remus.vehicle, remus.actuation, {"time_constant": 0.1}) for k in (FinLag, Another)]
    eta, nu, inputs, times = turning(remus)
    with pytest.raises(ConfigError, match="fin_lag and another_lag"):
        GreyBox(remus.vehicle, effects).rollout(eta, nu, inputs, times)
