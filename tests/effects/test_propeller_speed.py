"""Losses by inflow go by the propellers' actual speed, along every way in which a model is run."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.func import functional_call

from auvnn.compiled import toolchain
from auvnn.estimation.window_simulation import Thrust, simulate_windows, substeps_of
from auvnn.exports.check import agreement
from auvnn.exports.system import System
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.windows import cut_windows
from auvnn.models import Inputs, load
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.free_running.rate import state_rate, unit_attitude
from auvnn.models.linear.state_space import StateSpace
from auvnn.online.residual import Predictor, Sample
from auvnn.physics.attitude import quat_to_matrix
from auvnn.plants import PLANTS, PlantTask
from auvnn.studies.benchmark.identifiability.oracle_slopes import Course, accelerations

DOUBLE = torch.float64
LAG = {"propeller_lag": {"time_constant": 0.3}}
LOSS = {"thrust_inflow_loss": {"coefficient": 4.0}}
ADVANCE = {"thrust_advance": {"loss": 0.5, "speed": 1.0}}
BAND = {"thruster_deadband": {"width": 0.05}}
FINS = {"fin_lag": {"time_constant": 0.15}}
BOTH = LAG | LOSS


@pytest.fixture(scope="module")
def compiler():
    if not toolchain.compiler():
        pytest.skip("no C compiler")


@pytest.fixture(scope="module")
def rov():
    return load("bluerov2_heavy")


@pytest.fixture(scope="module")
def remus():
    return load("remus100")


def stirred(model, rows=40, dt=0.05, batch=(), seed=3):
    """Return start, inputs and times of a vehicle at speed whose commands jump about, through zero too."""
    generator = torch.Generator().manual_seed(seed)
    eta = torch.zeros(*batch, 7, dtype=DOUBLE)
    eta[..., 2], eta[..., 3] = 5.0, 1.0
    nu = torch.zeros(*batch, 6, dtype=DOUBLE)
    nu[..., 0] = 1.2

    def jumps(size, count):
        found = torch.rand(*batch, rows // 5 + 1, count, generator=generator, dtype=DOUBLE)
        return (size * (2.0 * found - 1.0)).repeat_interleave(5, dim=-2)[..., :rows, :]

    fins = jumps(0.1, len(model.vehicle.fins)) if model.vehicle.fins else None
    return (
        eta, nu, Inputs(jumps(0.6, model.actuators.size), fins), dt * torch.arange(rows, dtype=DOUBLE)
    )  # fmt: skip


def task_of(model, effects, start, batch=None, **more):
    eta, nu, inputs, times = start
    return PlantTask(
        vehicle=model.vehicle, actuation=model.actuation, effects=effects, strangers={},
        model=model.with_effects(effects), eta0=eta.numpy(), nu0=nu.numpy(), t=times.numpy(),
        command=inputs.command.numpy(), fins=None if inputs.fins is None else inputs.fins.numpy(), voltage=None,
        bottom=None, max_step=0.01, **more,
    )  # fmt: skip


def test_the_speed_counts_only_where_something_goes_by_it(rov):
    assert not speeds_follow(rov.with_effects(LAG)) and not speeds_follow(rov.with_effects(LOSS))
    for effects in (BOTH, LAG | ADVANCE):
        model = rov.with_effects(effects)
        assert speeds_follow(model)
        run = model.rollout(*stirred(model))
        assert run.speeds.shape == run.thrust.shape and run.acting.shape[-1] == 2 * model.actuators.size
    assert rov.with_effects(LOSS).rollout(*stirred(rov)).speeds is None


def test_a_propeller_that_runs_down_still_loses_thrust_by_inflow(rov):
    """The wrench in closed form: after the command has gone to zero the loss fades as the speed does."""
    model = rov.with_effects(BOTH)
    eta, nu, inputs, times = stirred(model)
    command = torch.full_like(inputs.command, 0.8)
    command[1:] = 0.0
    run = model.rollout(eta, nu, Inputs(command), times, max_step=0.05)
    mean = 0.3 / 0.05 * (1.0 - math.exp(-0.05 / 0.3))
    speeds = 0.8 * mean * torch.exp(-(times[1:] - times[1]) / 0.3)
    torch.testing.assert_close(run.speeds[1:], speeds.unsqueeze(-1).expand(-1, 8))
    with torch.no_grad():
        at = (eta[:3], torch.eye(3, dtype=DOUBLE), nu, run.acting[5], Inputs(command[5]), times[5])
        found = (
            model.wrenches(*at)["thrust"]
            - rov.with_effects(LAG).wrenches(*at[:3], run.thrust[5], *at[4:])["thrust"]
        )
        columns = model.actuators.allocation
        expected = -columns @ (4.0 * speeds[4] * (columns.mT @ nu))
    torch.testing.assert_close(found, expected)
    assert expected[0] < -0.5


@pytest.mark.parametrize("loss", [LOSS, ADVANCE])
@pytest.mark.parametrize("before", [{}, BAND])
def test_rows_so_short_that_the_speed_is_constant_in_each_give_the_same(rov, loss, before):
    """Thrust of the lagged command behind a dead band, loss by the lagged command itself, both worked out by hand."""
    start = eta, nu, inputs, times = stirred(rov, rows=16, dt=0.02)
    found = rov.with_effects(before | LAG | loss).rollout(*start, max_step=0.01)
    fine = 40
    t = torch.linspace(0.0, float(times[-1]), fine * (len(times) - 1) + 1, dtype=DOUBLE)
    half = math.exp(-0.5 * float(t[1]) / 0.3)

    def followed(wanted):
        speed, out = wanted[0], []
        for k in range(len(t)):
            command = wanted[min(k // fine, len(times) - 1)]
            # Half-way through the short row.
            out.append(command + (speed - command) * half)
            speed = command + (speed - command) * half * half
        return torch.stack(out)

    shaped = inputs.command
    if before:
        shaped = rov.with_effects(BAND).effects[0].command(shaped, times).detach()
    thrust, turned = rov.actuators.static(followed(shaped)), followed(inputs.command)
    model, y, h = rov.with_effects(loss), torch.cat([eta, nu]), float(t[1])
    expected = [y]
    with torch.no_grad():
        for k in range(len(t) - 1):
            given = (thrust[k], Inputs(turned[k]), t[k], None)
            y = unit_attitude(y + h * state_rate(model, y + 0.5 * h * state_rate(model, y, *given), *given))
            expected.append(y)
    expected = torch.stack(expected)[::fine, 7:]
    away = (found.nu - expected).abs().max()
    without = rov.with_effects(before | LAG).rollout(*start, max_step=0.01)
    # What is missed is the variance of the speed within a row, and the kink of the dead band.
    assert away < 0.03 * (without.nu - expected).abs().max()
    assert away < 2e-3


@pytest.mark.parametrize(
    ("name", "effects"),
    [
        ("bluerov2_heavy", BOTH),
        ("bluerov2_heavy", BAND | BOTH | {"actuation_delay": {"delay": 0.07}}),
        ("bluerov2_heavy", BOTH | {"thruster_lag": {"time_constant": 0.1}}),
        ("remus100", FINS | LAG | ADVANCE),
        ("remus100", BOTH),
    ],
)
def test_every_way_of_running_agrees(name, effects, compiler):
    vehicle = load(name)
    model = vehicle.with_effects(effects)
    eta, nu, inputs, times = stirred(model, batch=(3,))
    plain, machine = (
        model.rollout(eta, nu, inputs, times, max_step=0.025, engine=e) for e in ("torch", "compiled")
    )
    torch.testing.assert_close(machine.nu, plain.nu, rtol=1e-11, atol=1e-12)
    solved = model.rollout(eta, nu, inputs, times, solver="torchdiffeq:dopri5", rtol=1e-9, atol=1e-11)
    torch.testing.assert_close(solved.nu, plain.nu, rtol=0, atol=2e-4)
    if "actuation_delay" in effects:
        return
    # The torch engine's step for step: linearise and estimators walk with it.
    space = StateSpace(model, 0.05)
    x = space.settled(eta, nu, inputs.command[:, 0], None if inputs.fins is None else inputs.fins[:, 0])
    assert x.shape[-1] == len(space.state_names()) == space.size
    for k in range(len(times) - 1):
        u = space.join(inputs.command[:, k], None if inputs.fins is None else inputs.fins[:, k], None, None)
        x = space.step(x, u, times[k].expand(3), torch.full((3,), 0.05, dtype=DOUBLE), 2)
    torch.testing.assert_close(x[:, 7:13], plain.nu[:, -1], rtol=1e-11, atol=1e-12)


def test_a_state_space_with_a_dead_band_keeps_the_speed_apart(rov):
    plain, banded = (StateSpace(rov.with_effects(e)) for e in (BOTH, BAND | BOTH))
    assert banded.size == plain.size + 8
    assert [n for n in banded.state_names() if n.startswith("speed.")] == [
        f"speed.thruster_{k}" for k in range(1, 9)
    ]
    # Continuous time: the rate of the speed, and what acts now, are those of a first-order lag of the command.
    generator = torch.Generator().manual_seed(4)
    state = torch.rand(banded.actuators.states, generator=generator, dtype=DOUBLE)
    command = torch.rand(8, generator=generator, dtype=DOUBLE)
    acting, rate = banded.actuators.rate(state, command)
    torch.testing.assert_close(acting[8:], state[8:])
    torch.testing.assert_close(rate[8:], (command - state[8:]) / 0.3)


@pytest.mark.parametrize("tau", [0.0, 0.3])
def test_compiled_gradients_are_those_of_torch_at_the_null_too(rov, compiler, tau):
    model = rov.with_effects({"propeller_lag": {"time_constant": tau}} | LOSS)
    eta, nu, inputs, times = stirred(model)
    slopes = [
        torch.autograd.grad(
            model.rollout(eta, nu, inputs, times, engine=e, check=False).nu.square().sum(),
            [model.effect(n).theta for n in ("propeller_lag", "thrust_inflow_loss")],
        )
        for e in ("torch", "compiled")
    ]
    for plain, machine in zip(*slopes, strict=True):
        assert machine.item() == pytest.approx(plain.item(), rel=1e-9)
        assert abs(plain.item()) > 1e-3


def test_slopes_of_what_acts_over_windows_are_those_of_differences(rov):
    model = rov.with_effects(BOTH)
    log = logged(model)
    windows = cut_windows(log, 1.0, partial=True)
    found = simulate_windows(
        model, windows, initial_states(model, windows), ["propeller_lag", "thrust_inflow_loss"]
    )
    assert found.mean.shape[-1] == 16 and found.columns == [0]
    module, small = Thrust(model), 1e-6
    with torch.no_grad():
        moved = [
            functional_call(
                module, {"model.effects.0.theta": torch.tensor([0.3 + s * small], dtype=DOUBLE)},
                (windows, substeps_of(windows)),
            )[0]
            for s in (1, -1)
        ]  # fmt: skip
    torch.testing.assert_close(
        found.mean_slope[..., 0], (moved[0] - moved[1]) / (2 * small), rtol=1e-6, atol=1e-7
    )
    assert found.mean_slope[..., 8:, 0].abs().max() > 0.1


@pytest.mark.parametrize("effects", [BOTH, LAG | ADVANCE])
def test_the_independent_plant_and_the_own_stepper_move_alike(rov, effects):
    """Another formulation and another integrator, with the speed in continuous time."""
    model = rov.with_effects(effects)
    start = stirred(model, batch=(2,), dt=0.01, rows=80)
    task = task_of(rov, effects, start)
    own, other = (PLANTS.get(n)().move(task, lambda k, *seen: seen) for n in ("own", "numpy"))
    without = PLANTS.get("own")().move(task_of(rov, LAG, start), lambda k, *seen: seen)
    assert np.abs(own.nu - other.nu).max() < 1e-2 * np.abs(without.nu - other.nu).max()
    np.testing.assert_allclose(own.nu, other.nu, atol=4e-4)

    def controller(k, *seen):
        return start[2].command[:, k].numpy(), None

    stepped = PLANTS.get("own")().move(replace(task, controller=controller), lambda k, *seen: seen)
    np.testing.assert_allclose(stepped.nu, own.nu, atol=1e-10)
    np.testing.assert_allclose(stepped.nu_dot, own.nu_dot, atol=1e-8)


def logged(model, rows=60):
    eta, nu, inputs, times = stirred(model, rows=rows)
    run = model.rollout(eta, nu, inputs, times, max_step=0.025)
    place, attitude = run.eta.detach().split((3, 4), dim=-1)
    one = Run(
        1, times.numpy(), attitude.numpy(), run.nu.detach().numpy(), position=place.numpy(),
        thrusters=inputs.command.numpy(),
    )  # fmt: skip
    return Log((one,))


@pytest.mark.parametrize("effects", [BOTH, BAND | BOTH])
def test_exported_graphs_agree_with_the_model(rov, effects):
    found = agreement(System(rov.with_effects(effects), 0.05))
    assert max(found.values()) < 1e-9, found


@pytest.mark.parametrize("measured", [False, True])
def test_online_residuals_know_the_speed(rov, measured):
    """What the model itself has moved leaves nothing; the same samples with a model that goes by commands leave more."""
    model = rov.with_effects(BOTH)
    eta, nu, inputs, times = stirred(model)
    run = model.rollout(eta, nu, inputs, times, max_step=0.05)
    with torch.no_grad():
        rate = model.nu_dot(run.eta[:, :3], quat_to_matrix(run.eta[:, 3:]), run.nu, run.acting, inputs, times)
    rates = rate if measured else [None] * len(times)
    left = []
    for asked in (model, rov.with_effects(LAG)):
        predictor = Predictor(asked)
        errors = [
            predictor.take(Sample(float(t), e, n, c, a))
            for t, e, n, c, a in zip(
                times, run.eta.detach(), run.nu.detach(), inputs.command, rates, strict=True
            )
        ]
        left.append(max(float(r.error.abs().max()) for r in errors if r is not None))
    assert left[0] < 1e-6 < 0.1 < left[1]


def test_the_oracle_knows_the_speed(rov):
    """Its accelerations along the true motion are those by which the plant moved."""
    start = stirred(rov, batch=(2,), dt=0.05, rows=40)
    task = task_of(rov, BOTH, start)
    motion = PLANTS.get("numpy")().move(task, lambda k, *seen: seen)
    course = Course.of(task, motion, 2)
    found = accelerations(course, BOTH)
    apart = accelerations(course, LAG)
    nu = motion.nu[:, course.rows]
    measured = (nu[:, 1:] - nu[:, :-1]) / course.step
    # The mean of two rows is not the state half-way: that is what is left.
    left, more = (np.linalg.norm(x - measured) for x in (found, apart))
    assert left < 0.2 * more
