"""Commands that change within the interval of a row: against a run of which each part is a row of its own."""

from __future__ import annotations

import pytest
import torch

from auvnn.effects import EFFECTS
from auvnn.models import GreyBox, Inputs
from auvnn.models.free_running.rollout import rollout
from auvnn.testing.scene import typical_values
from tests.small_logs import small_vehicle

DOUBLE = torch.float64
PARTS, ROWS, STEP = 4, 12, 0.2
ACTING = ["thruster_lag", "thrust_overshoot", "actuation_delay", "thrust_curve", "thruster_deadband"]


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
