"""The own integrator: order, what it must be blind to, gradients, and how it reports a diverged run."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import euler_to_quat, quat_multiply
from auvnn.testing import make_scene
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64


def free_run(model, scene, **options):
    with torch.no_grad():
        return model.rollout(scene.eta, scene.nu, scene.inputs, scene.times, warmup=scene.warmup, **options)


@pytest.mark.parametrize(("solver", "order"), [("rk4", 4), ("midpoint", 2), ("euler", 1)])
def test_the_observed_order_is_that_of_the_method(rov, forced, solver, order):
    """Held commands, velocities that keep their sign (|nu| nu is smooth then), steps halved three times."""
    eta, nu, wrench = forced
    commands, times = wrench.expand(3, 6), torch.tensor([0.0, 0.4, 1.2], dtype=DOUBLE)

    def ends(solver, step):
        with torch.no_grad():
            run = rov.rollout(eta, nu, commands, times, solver=solver, max_step=step)
        assert (run.nu > 0).all()
        return torch.cat([run.eta[-1], run.nu[-1]])

    exact = ends("rk4", 0.002)
    errors = [float((ends(solver, 0.4 / 2**k) - exact).abs().max()) for k in range(2, 6)]
    observed = math.log2(errors[-2] / errors[-1])
    assert abs(observed - order) < 0.1, errors


def test_the_lag_does_not_spoil_the_order_over_resolved_steps(rov, forced):
    """The straight line that stands for the thrust over a step leaves an error of third order or better."""
    eta, nu, wrench = forced
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.4}})
    commands = torch.stack([0.3 * wrench, wrench, wrench])
    times = torch.tensor([-1.0, 0.0, 1.2], dtype=DOUBLE)

    def ends(step):
        with torch.no_grad():
            return model.rollout(eta, nu, commands, times, warmup=1, max_step=step).nu[-1]

    exact = ends(0.005)
    errors = [float((ends(step) - exact).abs().max()) for step in (0.2, 0.1, 0.05)]
    assert math.log2(errors[1] / errors[2]) > 2.9, errors


def test_commands_are_held_from_their_row_to_the_next(rov, forced):
    """Splitting an interval under the same command changes nothing; the last row does not act."""
    eta, nu, wrench = forced
    coarse, fine = (
        torch.tensor([0.0, 0.1, 0.2], dtype=DOUBLE),
        torch.tensor([0.0, 0.05, 0.1, 0.15, 0.2], dtype=DOUBLE),
    )
    commands = torch.stack([wrench, -wrench, 5 * wrench])
    a = rov.rollout(eta, nu, commands, coarse, max_step=0.05)
    b = rov.rollout(eta, nu, commands[[0, 0, 1, 1, 2]], fine, max_step=0.05)
    torch.testing.assert_close(a.nu[1], b.nu[2], rtol=1e-13, atol=1e-14)
    torch.testing.assert_close(a.eta[-1], b.eta[-1], rtol=1e-13, atol=1e-14)
    other = rov.rollout(eta, nu, torch.stack([wrench, -wrench, 0 * wrench]), coarse, max_step=0.05)
    assert torch.equal(other.nu, a.nu) and not torch.equal(other.thrust[-1], a.thrust[-1])
    assert torch.equal(a.thrust, commands)


def test_uneven_times_give_the_chain_of_their_intervals(example):
    scene = make_scene(example.vehicle, "thrusters", runs=1, rows=6, warmup=0).part(0)
    whole = free_run(example, scene, max_step=1.0)
    eta, nu = scene.eta, scene.nu
    for k in range(5):
        part = example.rollout(eta, nu, scene.inputs.rows(k, k + 2), scene.times[k : k + 2], max_step=1.0)
        eta, nu = part.eta[-1], part.nu[-1]
    torch.testing.assert_close(nu, whole.nu[-1], rtol=1e-12, atol=1e-13)
    torch.testing.assert_close(eta, whole.eta[-1], rtol=1e-12, atol=1e-13)


def test_equal_times_stand_still(rov, forced):
    """Windows of a log are padded by repeating their last row at an unchanged time."""
    eta, nu, wrench = forced
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.1}})
    run = model.rollout(eta, nu, wrench.expand(4, 6), torch.tensor([0.0, 0.1, 0.1, 0.1], dtype=DOUBLE))
    torch.testing.assert_close(run.nu[2:], run.nu[1].expand(2, 6), rtol=1e-14, atol=1e-15)
    torch.testing.assert_close(run.eta[2:], run.eta[1].expand(2, 7), rtol=1e-14, atol=1e-15)


def test_position_and_heading_of_the_start_do_not_matter(example):
    scene = make_scene(example.vehicle, "thrusters", runs=5, rows=10)
    here = free_run(example, scene)
    turn = euler_to_quat(torch.tensor([0, 0, 2.1], dtype=DOUBLE))
    shift = torch.tensor([10.0, -20.0, 3.0], dtype=DOUBLE)
    c, s = math.cos(2.1), math.sin(2.1)
    spin = torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=DOUBLE)
    start = torch.cat(
        [scene.eta[:, :3] @ spin.T + shift, quat_multiply(turn.expand(5, 4), scene.eta[:, 3:])], dim=-1
    )
    there = example.rollout(start, scene.nu, scene.inputs, scene.times, warmup=scene.warmup)
    torch.testing.assert_close(there.nu, here.nu, rtol=0, atol=1e-12)
    torch.testing.assert_close(there.eta[..., :3], here.eta[..., :3] @ spin.T + shift, rtol=0, atol=1e-12)
    turned = quat_multiply(turn.expand(5, 10, 4), here.eta[..., 3:])
    torch.testing.assert_close(there.eta[..., 3:], turned, rtol=0, atol=1e-12)


def test_a_batch_is_its_members(example, bank):
    model = GreyBox(example.vehicle, damping=bank).with_effects({"thruster_lag": {"time_constant": 0.2}})
    scene = make_scene(example.vehicle, "thrusters", runs=4, rows=6)
    whole = free_run(model, scene)
    for k in range(4):
        one = free_run(model, scene.part(k))
        torch.testing.assert_close(one.nu, whole.nu[k], rtol=1e-12, atol=1e-13)
        torch.testing.assert_close(one.thrust, whole.thrust[k], rtol=1e-12, atol=1e-13)


def test_times_may_differ_by_trajectory_and_commands_may_be_shared(rov, forced):
    eta, nu, wrench = forced
    commands = wrench.expand(4, 6) * torch.tensor([[1.0], [0.5], [-0.3], [0.2]], dtype=DOUBLE)
    times = torch.tensor([[0.0, 0.1, 0.2, 0.3], [5.0, 5.2, 5.25, 5.4]], dtype=DOUBLE)
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.1}})
    both = model.rollout(eta, nu, commands, times, max_step=0.1)
    # The number of steps per interval is that of the longest: two.
    for k in range(2):
        one = model.rollout(eta, nu, commands, times[k], max_step=0.1 if k else 0.05)
        torch.testing.assert_close(both.nu[k], one.nu, rtol=1e-12, atol=1e-13)


def test_euler_angles_start_the_same_run(rov, forced):
    eta, nu, wrench = forced
    times = torch.tensor([0.0, 0.1, 0.3], dtype=DOUBLE)
    by_quaternion = torch.cat([eta[:3], euler_to_quat(eta[3:])])
    a, b = (rov.rollout(start, nu, wrench.expand(3, 6), times) for start in (eta, by_quaternion))
    assert torch.equal(a.eta, b.eta) and torch.equal(a.nu, b.nu)


@pytest.mark.parametrize("solver", ["rk4", "euler"])
def test_quaternions_stay_unit_over_long_tumbling_runs(solver):
    model = GreyBox(load_vehicle("bluerov2"), actuation="wrench")
    times = torch.arange(0, 50, 0.25, dtype=DOUBLE)
    commands = torch.tensor([5.0, 3.0, -2.0, 4.0, 6.0, -5.0], dtype=DOUBLE).expand(200, 6)
    zero = torch.zeros(6, dtype=DOUBLE)
    with torch.no_grad():
        run = model.rollout(zero, zero, commands, times, solver=solver, max_step=0.125)
    assert not run.diverged
    assert run.eta[:, 3:].min() < -0.5, "it did not tumble"
    torch.testing.assert_close(run.eta[:, 3:].norm(dim=-1), torch.ones(200, dtype=DOUBLE), rtol=0, atol=1e-14)


def test_single_precision_runs_with_times_of_either_precision(example):
    scene = make_scene(example.vehicle, "thrusters", rows=6)
    exact = free_run(example, scene)
    single = GreyBox(example.vehicle).float()
    s = scene.change(lambda x: x.float())
    for times in (s.times, scene.times + 1e6):  # a clock that single precision cannot resolve
        with torch.no_grad():
            run = single.rollout(s.eta, s.nu, s.inputs, times, warmup=scene.warmup)
        assert run.nu.dtype == torch.float32
        torch.testing.assert_close(run.nu.double(), exact.nu, rtol=0, atol=1e-4)


def test_one_row_is_the_start_itself(rov, forced):
    eta, nu, wrench = forced
    for model in (rov, rov.with_effects({"thruster_lag": {"time_constant": 0.1}})):
        run = model.rollout(eta, nu, wrench.expand(1, 6), torch.zeros(1, dtype=DOUBLE))
        assert run.nu.shape == (1, 6) and torch.equal(run.nu[0], nu)


# Gradients


def test_the_gradient_of_a_run_is_right_in_start_commands_weights_and_effects(rov, bank):
    model = GreyBox(rov.vehicle, damping=bank, actuation="wrench").with_effects(
        {"ocean_current": {"v_north": 0.2}}
    )
    names = [name for name, _ in model.named_parameters()]
    values = [p.detach().clone().requires_grad_() for p in model.parameters()]
    scene = make_scene(rov.vehicle, "wrench", runs=1, rows=3, warmup=0).part(0)
    start = (scene.nu.clone().requires_grad_(), scene.inputs.command.clone().requires_grad_())
    mix = torch.randn(3, 26, generator=torch.Generator().manual_seed(2), dtype=DOUBLE)

    class Run(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.model = model

        def forward(self, nu, commands):
            run = self.model.rollout(scene.eta, nu, commands, scene.times, check=False, max_step=1.0)
            return mix @ torch.cat([run.eta[1:], run.nu[1:]], dim=-1).flatten()

    whole = Run()

    def outputs(nu, commands, *parameters):
        named = {f"model.{n}": p for n, p in zip(names, parameters, strict=True)}
        return torch.func.functional_call(whole, named, (nu, commands))

    torch.autograd.gradcheck(outputs, (*start, *values), eps=1e-6, rtol=1e-5, atol=1e-7, fast_mode=True)
    torch.autograd.gradcheck(outputs, (*start, *(v.detach() for v in values)), eps=1e-6, rtol=1e-6, atol=1e-7)


def test_forward_and_reverse_sensitivities_to_the_start_agree_under_vmap(example):
    scene = make_scene(example.vehicle, "thrusters", runs=3, rows=3, warmup=0)

    def end(nu, eta, command, fins):
        return example.rollout(eta, nu, Inputs(command, fins), scene.times, check=False, max_step=1.0).nu[-1]

    inputs = (scene.nu, scene.eta, scene.inputs.command, scene.inputs.fins)
    forward = torch.func.vmap(torch.func.jacfwd(end))(*inputs)
    reverse = torch.func.vmap(torch.func.jacrev(end))(*inputs)
    torch.testing.assert_close(forward, reverse, rtol=1e-10, atol=1e-12)


# Diverged runs


def test_a_run_with_damping_that_feeds_energy_says_when_and_which_term(rov):
    """u' = k u2 leaves every bound at t = 1 / (k u(0)); the slower batch-mate is not disturbed."""
    bank = DampingBank.from_description(
        {"form": "zero", "each": {"X": {"form": "polynomial", "coupled": False}}}
    )
    rate, mass = 2.0, 95.0 + 57.0
    for form in bank.groups():
        if form.name == "polynomial":
            with torch.no_grad():
                form.quadratic.fill_(-rate * mass)
    model = GreyBox(replace(rov.vehicle, damping_elements=()), damping=bank, actuation="wrench")
    starts = torch.zeros(2, 6, dtype=DOUBLE)
    starts[:, 0] = torch.tensor([0.3, 0.1], dtype=DOUBLE)
    level, times = torch.zeros(2, 6, dtype=DOUBLE), torch.arange(0, 3, 0.05, dtype=DOUBLE)
    commands = torch.zeros(len(times), 6, dtype=DOUBLE)
    for solver in ("rk4", "torchdiffeq:dopri5"):
        with torch.no_grad():
            run = model.rollout(level, starts, commands, times, solver=solver)
        assert run.diverged and [d.index for d in run.divergences] == [0]
        event = run.divergences[0]
        assert event.term == "damping subnetworks"
        assert abs(event.time - 1 / (rate * 0.3)) < 0.2
        assert "\n" not in event.words and event.term in event.words and f"{event.time:g} s" in event.words
        assert torch.isfinite(run.nu).all() and torch.isfinite(run.eta).all()
        last = int((times <= event.time + 1e-9).sum()) - 1
        assert torch.equal(run.nu[0, last:], run.nu[0, last].expand(len(times) - last, 6))
        expected = 0.1 / (1 - rate * 0.1 * times)
        torch.testing.assert_close(run.nu[1, :, 0], expected, rtol=1e-5, atol=0)


@pytest.mark.parametrize("solver", ["rk4", "torchdiffeq:dopri5", "torchdiffeq:rk4"])
def test_a_command_that_is_no_number_ends_the_run_there(rov, forced, solver):
    eta, nu, wrench = forced
    commands = wrench.repeat(2, 8, 1)
    commands[1, 5, 2] = torch.nan
    times = torch.arange(8, dtype=DOUBLE) * 0.1
    with torch.no_grad():
        run = rov.rollout(eta, nu, commands, times, solver=solver)
        sound = rov.rollout(eta, nu, commands[0], times, solver=solver)
    assert [(d.index, d.term) for d in run.divergences] == [(1, "thrust")]
    assert run.divergences[0].time == pytest.approx(0.5)
    assert torch.isfinite(run.nu).all()
    torch.testing.assert_close(run.nu[0], sound.nu, rtol=1e-6, atol=1e-8)


def test_absurd_thrust_is_named(rov, forced):
    eta, nu, wrench = forced
    run = rov.rollout(eta, nu, 1e7 * wrench.expand(5, 6), torch.arange(5, dtype=DOUBLE) * 0.1)
    assert [(d.time, d.term) for d in run.divergences] == [(0.0, "thrust")]
    assert torch.isfinite(run.nu).all()


def test_a_start_that_is_no_state_is_named(rov, forced):
    eta, nu, wrench = forced
    starts = torch.stack([nu, nu * torch.nan])
    for solver in ("rk4", "torchdiffeq:dopri5"):
        run = rov.rollout(
            eta, starts, wrench.expand(3, 6), torch.arange(3, dtype=DOUBLE) * 0.1, solver=solver
        )
        assert [(d.index, d.time, d.term) for d in run.divergences] == [(1, 0.0, "initial state")]
        assert torch.isfinite(run.nu[0]).all()


def test_with_fins_voltage_and_altitude_a_diverged_run_is_still_explained(example):
    scene = make_scene(example.vehicle, "thrusters", runs=3, rows=5)
    scene.inputs.command[2, -2] = torch.inf
    run = free_run(example, scene)
    assert [(d.index, d.term) for d in run.divergences] == [(2, "thrust")]


# Refusals


def test_what_does_not_fit_is_answered_in_one_line(rov, forced):
    eta, nu, wrench = forced
    commands, times = wrench.expand(5, 6), torch.arange(5, dtype=DOUBLE) * 0.1
    voltage = torch.zeros(4, dtype=DOUBLE)
    cases = [
        ((eta[:5], nu, commands, times), {}, r"eta0 has shape \(5,\)"),
        ((eta, nu[:3], commands, times), {}, r"nu0 has shape \(3,\)"),
        ((eta, nu, commands[0], times), {}, r"give rows, \(\.\.\., T, 6\)"),
        ((eta, nu, commands[:4], times), {}, "4 rows of commands for 5 times"),
        ((eta, nu, commands[:, :3], times), {}, r"3 commands a row, but the model takes 6 \(wrench\)"),
        ((eta, nu, Inputs(commands, voltage=voltage), times), {}, r"voltage of shape \(4,\) for 5 times"),
        (
            (eta.expand(3, 6), nu.expand(2, 6), commands, times),
            {},
            "do not fit together: eta0 .3,., nu0 .2,.",
        ),
        ((eta, nu, commands, times.flip(0)), {}, "times decrease"),
        ((eta, nu, commands, times * torch.nan), {}, "times hold NaN"),
        ((eta, nu, commands, times), {"warmup": 5}, "warmup=5 of 5 rows"),
        ((eta, nu, commands, times), {"warmup": -1}, "warmup=-1 of 5 rows"),
        ((eta, nu, commands, times), {"max_step": 0.0}, "max_step=0.0 s: give a positive step"),
        ((eta, nu, commands, times), {"max_step": math.nan}, "give a positive step"),
        (
            (eta, nu, commands, times),
            {"solver": "rk5"},
            "no solver called 'rk5'. There are: rk4, midpoint, euler",
        ),
        ((eta, nu, commands, times), {"rtol": 1e-6}, "solver rk4 has no option 'rtol'"),
        ((eta, nu, commands, times), {"solver": "torchdiffeq:rk9"}, "no method 'rk9'"),
        ((eta, nu, commands, times), {"solver": "torchdiffeq:rk4", "tol": 1.0}, "has no option 'tol'"),
    ]
    for arguments, options, words in cases:
        with pytest.raises(ConfigError, match=words) as caught:
            rov.rollout(*arguments, **options)
        assert "\n" not in str(caught.value)


def test_fin_angles_that_do_not_fit_the_vehicle_are_refused(example):
    scene = make_scene(example.vehicle, "thrusters", runs=2)
    scene.inputs.fins.resize_(2, 6, 1)
    with pytest.raises(ConfigError, match=r"fins of shape \(2, 6, 1\): the vehicle has 2 fins"):
        free_run(example, scene)
