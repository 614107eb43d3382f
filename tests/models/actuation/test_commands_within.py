"""Commands that change within the interval of a row: against a run of which each part is a row of its own."""

from __future__ import annotations

import pytest
import torch

from auvnn.effects import EFFECTS
from auvnn.models import GreyBox, Inputs
from auvnn.models.free_running.one_interval import one_interval
from auvnn.models.free_running.rollout import rollout
from auvnn.testing.scene import typical_values
from auvnn.vehicle import load_vehicle
from tests.small_logs import small_vehicle

DOUBLE = torch.float64
PARTS, ROWS, STEP = 4, 12, 0.2
ACTING = [
    "thruster_lag", "thrust_overshoot", "actuation_delay", "thrust_curve", "thrust_polynomial", "thruster_deadband",
]  # fmt: skip


@pytest.fixture(scope="module")
def given():
    """Start, times of rows and of parts, and commands over the parts (2, rows, parts, 8)."""
    random = torch.Generator().manual_seed(5)
    within = 0.9 * (2.0 * torch.rand(2, ROWS, PARTS, 8, dtype=DOUBLE, generator=random) - 1.0)
    eta = torch.tensor([0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0], dtype=DOUBLE).expand(2, 7)
    nu = 0.2 * torch.rand(2, 6, dtype=DOUBLE, generator=random)
    times = STEP * torch.arange(ROWS, dtype=DOUBLE)
    fine = STEP / PARTS * torch.arange(ROWS * PARTS, dtype=DOUBLE)
    return eta, nu, times, fine, within


def runs(model, given, engine, warmup=0, max_step=STEP / PARTS):
    """Return states at the rows, by parts of an interval and by rows of their own."""
    eta, nu, times, fine, within = given
    by_parts = rollout(
        model,
        eta,
        nu,
        Inputs(within.mean(-2), within=within),
        times,
        max_step=max_step,
        warmup=warmup,
        engine=engine,
    )
    by_rows = rollout(
        model,
        eta,
        nu,
        Inputs(within.flatten(1, 2)),
        fine,
        max_step=STEP,
        warmup=warmup * PARTS,
        engine=engine,
    )
    return by_parts, by_rows


@pytest.mark.parametrize("engine", ["torch", "firm"])
@pytest.mark.parametrize("effects", [[], *([n] for n in ACTING)], ids=lambda names: "".join(names) or "bare")
def test_parts_of_an_interval_are_rows_of_their_own(given, effects, engine):
    vehicle = small_vehicle()
    values = {n: typical_values(EFFECTS.get(n), vehicle, "thrusters", 0.6) for n in effects}
    model = GreyBox(vehicle).with_effects(values)
    with torch.no_grad():
        parts, rows = runs(model, given, engine, warmup=3)
    torch.testing.assert_close(parts.eta, rows.eta[:, ::PARTS], rtol=1e-11, atol=1e-12)
    torch.testing.assert_close(parts.nu, rows.nu[:, ::PARTS], rtol=1e-11, atol=1e-12)
    torch.testing.assert_close(parts.thrust, rows.thrust[:, ::PARTS], rtol=1e-11, atol=1e-12)


def test_several_steps_may_share_a_part(given):
    """Half the step, and twice as many steps in every part as in a row of its own."""
    model = GreyBox(small_vehicle())
    eta, nu, times, fine, within = given
    with torch.no_grad():
        inputs = Inputs(within.mean(-2), within=within)
        parts = rollout(model, eta, nu, inputs, times, max_step=STEP / PARTS / 2)
        rows = rollout(model, eta, nu, Inputs(within.flatten(1, 2)), fine, max_step=STEP / PARTS / 2)
    torch.testing.assert_close(parts.nu, rows.nu[:, ::PARTS], rtol=1e-11, atol=1e-12)


def test_where_steps_and_parts_do_not_match_the_command_of_the_row_holds(given):
    model = GreyBox(small_vehicle())
    eta, nu, times, _, within = given
    with torch.no_grad():
        found = rollout(model, eta, nu, Inputs(within.mean(-2), within=within), times, max_step=STEP / 3)
        held = rollout(model, eta, nu, Inputs(within.mean(-2)), times, max_step=STEP / 3)
    assert torch.equal(found.nu, held.nu)


@pytest.fixture(scope="module")
def finned():
    """A vehicle with fins under way, and its inputs over the parts: commands (2, rows, parts, n) and fin angles."""
    vehicle = load_vehicle("remus100")
    random = torch.Generator().manual_seed(6)

    def draw(count):
        return 2.0 * torch.rand(2, ROWS, PARTS, count, dtype=DOUBLE, generator=random) - 1.0

    nu = torch.tensor([1.5, 0.1, -0.1, 0.05, 0.1, -0.1], dtype=DOUBLE).expand(2, 6)
    return vehicle, nu, 0.5 * draw(len(vehicle.thrusters)), 0.3 * draw(vehicle.n_fins)


@pytest.mark.parametrize("engine", ["torch", "firm"])
@pytest.mark.parametrize(
    "effects", [[], ["fin_lag"], ["fin_stall"], ["thruster_lag"], ["fin_lag", "thruster_lag"]]
)
def test_parts_of_an_interval_with_fins_are_rows_of_their_own(given, finned, effects, engine):
    eta, _, times, fine, _ = given
    vehicle, nu, commands, fins = finned
    values = {n: typical_values(EFFECTS.get(n), vehicle, "thrusters", 0.6) for n in effects}
    model = GreyBox(vehicle).with_effects(values)
    by_parts = Inputs(commands.mean(-2), fins.mean(-2), within=commands, fins_within=fins)
    by_rows = Inputs(commands.flatten(1, 2), fins.flatten(1, 2))
    with torch.no_grad():
        parts = rollout(model, eta, nu, by_parts, times, max_step=STEP / PARTS, warmup=3, engine=engine)
        rows = rollout(model, eta, nu, by_rows, fine, max_step=STEP, warmup=3 * PARTS, engine=engine)
    torch.testing.assert_close(parts.eta, rows.eta[:, ::PARTS], rtol=1e-11, atol=1e-12)
    torch.testing.assert_close(parts.nu, rows.nu[:, ::PARTS], rtol=1e-11, atol=1e-12)


def test_each_interval_by_itself_leads_to_the_next_row_with_fins_that_change_within(given, finned):
    """From every state of a run, one interval leads to the next state of the same run."""
    eta, _, times, _, _ = given
    vehicle, nu, commands, fins = finned
    model = GreyBox(vehicle)
    inputs = Inputs(commands.mean(-2), fins.mean(-2), within=commands, fins_within=fins)
    drive = model.actuators.drive(
        inputs.command, times.expand(2, -1), [], PARTS, 0, inputs.fins, commands, fins
    )
    with torch.no_grad():
        run = rollout(model, eta, nu, inputs, times, max_step=STEP / PARTS, engine="firm")
        states = torch.cat([run.eta, run.nu], dim=-1)
        found = one_interval(model, states, inputs, times.expand(2, -1), drive, PARTS)
    torch.testing.assert_close(found, states[:, 1:], rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("engine", ["torch", "firm"])
def test_fins_go_by_parts_only_where_steps_match(given, finned, engine):
    eta, _, times, _, _ = given
    vehicle, nu, commands, fins = finned
    model, plain = GreyBox(vehicle), Inputs(commands.mean(-2), fins.mean(-2))
    inputs = Inputs(plain.command, plain.fins, within=commands, fins_within=fins)
    with torch.no_grad():
        held = rollout(model, eta, nu, plain, times, max_step=STEP / 3, engine=engine)
        found = rollout(model, eta, nu, inputs, times, max_step=STEP / 3, engine=engine)
        parts = rollout(model, eta, nu, inputs, times, max_step=STEP / PARTS, engine=engine)
    assert torch.equal(found.nu, held.nu)
    assert not torch.allclose(parts.nu, held.nu, atol=1e-4)
