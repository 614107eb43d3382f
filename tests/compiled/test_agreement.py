"""Compiled runs against the torch functions they were made from: random models, random states, values and gradients."""

from __future__ import annotations

import pytest
import torch

from auvnn.compiled.program import Numbers
from auvnn.compiled.recorder import CannotCompile
from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox, Inputs
from auvnn.models import engine as engines
from auvnn.models import model_kernels as kernels
from auvnn.models.free_running.rate import unit_attitude
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64

MIXED = {"form": "mlp", "each": {"K": "zero", "M": "polynomial", "N": "dissipative"}}
CASES = {
    "rov95, six networks, a current": (
        "rov95", "mlp", "wrench", {"ocean_current": {"v_north": 0.2, "v_east": -0.1}, "added_mass": None},
    ),
    "rov90, mixed forms, a lag and a delay, sagging voltage": (
        "rov90", MIXED, "thrusters",
        {"thruster_lag": {"time_constant": 0.15}, "actuation_delay": {"delay": 0.12}, "voltage_droop": None,
         "waves": {"amplitude": 0.2}},
    ),
    "bluerov2, dissipative, a leak (inertia that changes while it runs)": (
        "bluerov2", "dissipative", "thrusters", {"flooding": {"rate": 0.01}, "thruster_gain": None},
    ),
    "remus100 with fins, polynomial, near the bottom": (
        "remus100", "polynomial", "wrench", {"bottom_proximity": None, "munk_moment": None, "payload": None},
    ),
    "remus100, fins that lag, a propeller in its inflow, near the bottom, sagging voltage": (
        "remus100", "polynomial", "thrusters",
        {"fin_lag": {"time_constant": 0.15}, "thrust_inflow_loss": None, "thrust_advance": {"loss": 0.2},
         "bottom_proximity": {"strength": 0.5}, "voltage_droop": {"exponent": 1.0}},
    ),
}  # fmt: skip


def random_model(case, seed=0):
    vehicle, damping, actuation, effects = CASES[case]
    bank = DampingBank.from_description(damping)
    model = GreyBox(load_vehicle(vehicle), (), bank, actuation).with_effects(effects)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        bank = model.damping
        bank.input_scale.copy_(torch.tensor([0.7, 0.5, 0.4, 0.3, 0.3, 0.6], dtype=DOUBLE))
        bank.output_scale.copy_(torch.tensor([3.0, 4.0, 5.0, 0.3, 0.4, 0.5], dtype=DOUBLE))
        for parameter in bank.parameters():
            parameter.add_(0.2 * torch.randn(parameter.shape, generator=generator, dtype=DOUBLE))
        for effect in model.members:
            for k, known in enumerate(effect.parameters_of):
                if float(effect.theta[k]) == known.null:
                    effect.theta[k] += 0.1 * known.scale * torch.rand((), generator=generator, dtype=DOUBLE)
    return model


def random_run(model, batch, rows, seed=1):
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape):
        return torch.randn(*shape, generator=generator, dtype=DOUBLE)

    y = draw(*batch, 13)
    y[..., 2] = 8.0 + y[..., 2]
    y[..., 7:] *= 0.4
    y = unit_attitude(y)
    size, fins = model.actuators.size, len(model.vehicle.fins)
    command = draw(*batch, rows, size) * (
        torch.tensor([40.0] * 3 + [4.0] * 3) if model.actuation == "wrench" else 0.3
    )
    inputs = Inputs(
        command,
        0.2 * draw(*batch, rows, fins) if fins else None,
        15.0 + draw(*batch, rows),
        3.0 + draw(*batch, rows).abs(),
    )
    times = torch.cumsum(0.02 + 0.02 * torch.rand(rows, generator=generator, dtype=DOUBLE), 0)
    return y[..., :7], y[..., 7:], inputs, times


def both(model, run, **options):
    return [model.rollout(*run, engine=e, check=False, **options) for e in ("torch", "compiled")]


def relative(mine, theirs):
    return float((mine - theirs).abs().max() / theirs.abs().max())


@pytest.mark.parametrize("case", CASES)
def test_values_and_gradients_agree(compiler, case):
    """In everything that autograd can be asked for: states, commands, fins, voltage, altitude, all parameters."""
    model = random_model(case)
    eta, nu, inputs, times = random_run(model, (5,), 9)
    leaves = [
        eta,
        nu,
        *(x for x in (inputs.command, inputs.fins, inputs.voltage, inputs.altitude) if x is not None),
    ]
    for leaf in leaves:
        leaf.requires_grad_()
    found = []
    for run in both(model, (eta, nu, inputs, times), max_step=0.025):
        generator = torch.Generator().manual_seed(5)
        up = torch.randn(5, 9, 13, generator=generator, dtype=DOUBLE)
        whole = torch.cat([run.eta, run.nu], dim=-1)
        over = [*leaves, *model.parameters()]
        slopes = torch.autograd.grad(whole, over, up, allow_unused=True)
        found.append(
            (
                whole.detach(),
                [torch.zeros_like(x) if g is None else g for x, g in zip(over, slopes, strict=True)],
            )
        )
    (value, slopes), (mine, own) = found
    assert relative(mine, value) < 1e-12
    names = ["eta", "nu", "command", "fins", "voltage", "altitude"][: len(leaves)] + [
        n for n, _ in model.named_parameters()
    ]
    moved = 0
    for name, a, b in zip(names, own, slopes, strict=False):
        assert bool((b == 0).all()) == bool((a == 0).all()), name
        if bool(b.any()):
            moved += 1
            assert relative(a, b) < 1e-10, name
    assert moved > 5


@pytest.mark.parametrize("case", list(CASES)[:1])
def test_the_derivative_agrees_at_many_states_and_other_weights(compiler, case):
    """One compiled kernel serves all values of the parameters."""
    model = random_model(case)
    assert engines.why_not(model, gradient=False) == ""
    inputs = Inputs(torch.zeros(1, model.actuators.size, dtype=DOUBLE))
    for seed in range(3):
        other = random_model(case, seed)
        made = kernels._made(other, inputs, False, engines_tableau())
        side = kernels._RightHandSide(other)
        samples = kernels._samples(made.code.layout, 40, seed=10 + seed)
        y, given = samples["y"], [samples.get(n) for n, _ in made.code.layout.inputs]
        u = torch.cat([x.reshape(40, -1) for x in given if x is not None], -1)
        with torch.no_grad():
            expected = side(y, *given)
        for lot in (slice(0, 40), slice(0, 1)):  # side by side, and one alone
            assert relative(made.code.rate(y[lot], u[lot], Numbers.of(side).row()), expected[lot]) < 1e-12


def engines_tableau():
    from auvnn.models.free_running.rollout import TABLEAUS

    return TABLEAUS["rk4"]


@pytest.mark.parametrize("solver", ["midpoint", "euler"])
def test_other_schemes_agree_too(compiler, solver):
    model = GreyBox(load_vehicle("rov95"), actuation="wrench")
    with torch.no_grad():
        run = random_run(model, (), 12)
        a, b = both(model, run, solver=solver)
    assert relative(b.nu, a.nu) < 1e-12
    assert relative(b.eta, a.eta) < 1e-12


def test_leading_shapes_broadcast_as_in_torch(compiler):
    model = GreyBox(load_vehicle("rov95"), actuation="wrench")
    with torch.no_grad():
        eta, nu, inputs, times = random_run(model, (2, 3), 6)
        a, b = both(model, (eta[0, 0], nu, Inputs(inputs.command[:, :1]), times))
        assert b.nu.shape == (2, 3, 6, 6)
        assert relative(b.nu, a.nu) < 1e-12
        own_times = times + torch.arange(2.0, dtype=DOUBLE).reshape(2, 1, 1)
        a, b = both(model, (eta, nu, Inputs(inputs.command[0, 0]), own_times))
        assert relative(b.nu, a.nu) < 1e-12


def test_a_diverging_run_is_reported_as_by_torch(compiler):
    model = GreyBox(load_vehicle("rov95"), actuation="wrench")
    with torch.no_grad():
        eta, nu, inputs, times = random_run(model, (3,), 8)
        nu[1] = 1e6
        one, other = (
            model.rollout(eta, nu, Inputs(inputs.command), times, engine=e) for e in ("torch", "compiled")
        )
    assert [(d.index, d.time, d.term) for d in one.divergences] == [
        (d.index, d.time, d.term) for d in other.divergences
    ]
    assert one.diverged


@pytest.mark.parametrize("more", [(1, 0), (0, 1), (-1, 0), (0, -1)])
def test_inputs_of_other_sizes_are_refused_and_not_read_from_elsewhere(compiler, more):
    """The code steps through memory by the sizes that it was made for."""
    model = GreyBox(load_vehicle("rov95"), actuation="wrench")
    inputs = Inputs(torch.zeros(4, 6, dtype=DOUBLE))
    kernel = kernels._made(model, inputs, False, engines_tableau()).code
    y0, times = torch.zeros(1, 13, dtype=DOUBLE), torch.arange(4.0, dtype=DOUBLE).unsqueeze(0)
    y0[:, 3] = 1.0
    numbers = Numbers.of(kernels._RightHandSide(model)).row()
    drive, row = (
        torch.zeros(1, 4, 1, 6 + more[0], dtype=DOUBLE),
        torch.zeros(1, 4, 6 + more[1], dtype=DOUBLE),
    )
    with pytest.raises(CannotCompile, match="numbers as inputs"):
        kernel.run(y0, drive, None, row, times, numbers, 1)
