"""A measured velocity that steps as no force makes it: nothing is learned until a sensor's fault would have shown."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.online import Adapter
from tests.online.online_world import driven, parameters, vehicle

RATE = 20.0
NOISE = 0.003


@pytest.fixture(scope="module")
def run():
    """Fourteen seconds at 20 Hz of a vehicle whose drag is the model's."""
    return driven(vehicle(), duration=14.0, rate=RATE, noise=(NOISE, 0.0))


def steps(adapter, run, nu, rows, measured=False):
    """Feed rows with other velocities, with or without a measured acceleration."""
    return [
        adapter.step(run.t[k], run.eta[k], nu[k], run.wrench[k], run.nu_dot[k] if measured else None)
        for k in rows
    ]


def healthy(adapter, run, rows, measured=False):
    """Feed sound rows, and return the parameters after each of the last 4.1 s: what may stand once a fault shows."""
    rows = list(rows)
    steps(adapter, run, run.nu, rows[:-82], measured)
    found = []
    for k in rows[-82:]:
        steps(adapter, run, run.nu, [k], measured)
        found.append(parameters(adapter))
    return found


@pytest.mark.parametrize("measured", [False, True], ids=["increments", "accelerations"])
def test_nothing_is_learned_of_a_gyro_that_begins_to_report_a_bias(run, measured):
    adapter, nu = Adapter(vehicle(), watch=False), np.array(run.nu)
    begin, end = 160, 240
    nu[begin:end, 5] += 0.2
    before = healthy(adapter, run, range(begin), measured)
    during = steps(adapter, run, nu, range(begin, end), measured)
    assert not any(u.adapted for u in during)
    assert {u.cause for u in during} <= {"gated", "velocity_step", "inconsistent"}
    assert during[-1].cause == "inconsistent"
    # The last seconds before a fault showed may be given up; nothing of it is kept.
    assert any(torch.equal(parameters(adapter), p) for p in before)


def test_what_was_learned_while_a_bias_began_to_show_is_taken_back(run):
    """Without the wait something of it is learned first; once attitude contradicts the rates, that is given up."""
    adapter, nu = Adapter(vehicle(), watch=False, guards={"step_hold": 0.0}), np.array(run.nu)
    nu[160:, 5] += 0.2
    before = healthy(adapter, run, range(160))
    learned = []
    for k in range(160, 240):
        (update,) = steps(adapter, run, nu, [k])
        learned.append(update.adapted)
    assert any(learned) and not learned[-1]
    assert any(torch.equal(parameters(adapter), p) for p in before)


def test_velocities_of_three_times_the_size_are_not_learned_before_positions_refute_them(run):
    adapter, nu = Adapter(vehicle(), watch=False), np.array(run.nu)
    begin = 170
    assert np.linalg.norm(nu[begin, :3]) > 0.15
    nu[begin:, :3] *= 3.0
    before = healthy(adapter, run, range(begin))
    during = steps(adapter, run, nu, range(begin, begin + 60))
    assert not any(u.adapted for u in during)
    assert during[-1].cause == "positions_disagree"
    assert any(torch.equal(parameters(adapter), p) for p in before)


def test_after_a_spike_it_goes_on_at_once(run):
    adapter, nu = Adapter(vehicle(), watch=False), np.array(run.nu)
    nu[160, 1] += 1.5
    steps(adapter, run, nu, range(160))
    after = steps(adapter, run, nu, range(160, 172))
    assert not after[0].adapted
    assert all(u.adapted for u in after[3:])


@pytest.mark.parametrize("force", [25.0, 400.0])
def test_a_force_that_sets_in_is_no_step_and_is_learned_within_a_second(run, force):
    """A force of any size changes the acceleration: at 20 Hz even 400 N on 95 kg is no impulse that ends at once."""
    hooked = driven(
        vehicle(), lambda m: m.with_effects({"constant_force": {"Y": force}}), when=6.0, duration=8.0,
        rate=RATE, noise=(NOISE, 0.0),
    )  # fmt: skip
    adapter = Adapter(vehicle(), watch=False)
    updates = steps(adapter, hooked, np.array(hooked.nu), range(hooked.samples))
    assert any(u.adapted for u in updates[120:140])
    assert sum(u.cause == "velocity_step" for u in updates) < 5


def test_motion_that_begins_is_no_step():
    """Thrust that sets in after rest is explained by the model, 30 % of drag missing or not."""
    command = np.zeros((161, 6))
    command[80:, 0] = 120.0
    run = driven(vehicle(), command=command, rate=RATE, noise=(NOISE, 0.0))
    adapter = Adapter(vehicle(), watch=False)
    updates = steps(adapter, run, np.array(run.nu), range(run.samples))
    assert not any(u.cause == "velocity_step" for u in updates)


def test_the_wait_is_an_option_and_survives_a_restart(run, tmp_path):
    nu = np.array(run.nu)
    nu[160:, 5] += 0.2
    adapter = Adapter(vehicle(), watch=False)
    steps(adapter, run, nu, range(162))
    adapter.save(tmp_path / "state")
    again = Adapter.restore(tmp_path / "state")
    ours, theirs = (steps(a, run, nu, range(162, 230)) for a in (adapter, again))
    assert [u.cause for u in ours] == [u.cause for u in theirs]
    assert torch.equal(parameters(adapter), parameters(again))
    free = Adapter(vehicle(), watch=False, guards={"step_hold": 0.0})
    steps(free, run, nu, range(160))
    assert any(u.adapted for u in steps(free, run, nu, range(160, 166)))
