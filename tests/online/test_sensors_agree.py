"""Velocity against positions, and attitudes that are none: what contradicts itself is refused, never learned."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.online import Adapter
from auvnn.online.positions import Positions
from auvnn.online.residual import Sample
from tests.online.online_world import driven, fed, parameters, vehicle

SCALE = np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def run():
    return driven(vehicle(), duration=20.0, noise=(2e-3, 0.0))


def test_velocity_three_times_too_large_is_refused_and_the_reason_told(run):
    adapter = Adapter(vehicle(), watch=True)
    held = parameters(adapter)
    noisy = run.position + 0.02 * np.random.default_rng(0).standard_normal(run.position.shape)
    updates = fed(adapter, replace(run, nu=run.nu * SCALE, position=noisy), measured=False)
    causes = Counter(u.cause for u in updates)
    assert causes["positions_disagree"] > 0.85 * run.samples and causes["adapted"] < 10
    told = next(u for u in updates if u.cause == "positions_disagree")
    assert "does not lead from position to position" in told.reason
    # What was learned while that began to show is taken back.
    assert torch.equal(parameters(adapter), held) and not adapter.changes


def test_a_fault_that_begins_later_leaves_what_was_learned_before(run):
    nu = np.array(run.nu)
    nu[120:] *= SCALE
    adapter = Adapter(vehicle(), watch=False)
    updates = fed(adapter, replace(run, nu=nu), measured=False)
    assert sum(u.adapted for u in updates[:120]) > 80
    assert {u.cause for u in updates[130:]} <= {"positions_disagree"}


def judged(run, position, factor=1.0) -> np.ndarray:
    positions, last, found = Positions(), None, []
    for k in range(run.samples):
        nu = torch.tensor(run.nu[k] * np.where(SCALE > 1.0, factor, 1.0))
        eta = torch.tensor(np.concatenate([position[k], run.quaternion[k]]))
        sample = Sample(float(run.t[k]), eta, nu, torch.zeros(6))
        found.append(positions.disagree(last, sample))
        last = sample
    return np.array(found)


@pytest.fixture(scope="module")
def long():
    return driven(vehicle(), duration=60.0, noise=(5e-3, 0.0))


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_true_velocities_pass_and_false_ones_do_not(long, every, noise):
    """Positions with every sample and once a second (held between), of 2 and 10 cm of noise."""
    fixes = long.position + noise * np.random.default_rng(2).standard_normal(long.position.shape)
    fixes = fixes[np.arange(long.samples) // every * every]
    for factor in (0.9, 1.1):
        assert not judged(long, fixes, factor).any()
    for factor in (3.0, 1.0 / 3.0):
        wrong = judged(long, fixes, factor)
        assert wrong.any() and np.argmax(wrong) < 300
        if factor == 3.0:
            assert wrong[300:].mean() > 0.95


def test_a_position_set_anew_is_no_fault_of_the_velocity(long):
    fixes = np.array(long.position)
    fixes[300:] += [8.0, -3.0, 0.0]
    assert not judged(long, fixes).any()
    assert judged(long, fixes, 3.0)[:300].any() and judged(long, fixes, 3.0)[450:].all()


def test_depth_alone_is_judged_by_the_depth_alone(long):
    depth = long.position * [0.0, 0.0, 1.0]
    assert not judged(long, depth).any()
    assert judged(long, depth, 3.0).any()


@pytest.mark.parametrize("quaternion", [[0.0] * 4, [0.5, 0, 0, 0], [2.0, 0, 0, 0], [1e300] * 4, [np.nan] * 4])
def test_attitudes_that_are_no_rotation_are_refused(run, quaternion):
    adapter = Adapter(vehicle(), guards="none", watch=False)
    fed(adapter, run, range(15))
    held = parameters(adapter)
    eta = np.concatenate([run.position[15], quaternion])
    update = adapter.step(run.t[15], eta, run.nu[15], run.wrench[15], run.nu_dot[15])
    assert update.cause == ("not_finite" if np.isnan(quaternion[0]) else "no_rotation")
    assert torch.equal(parameters(adapter), held)
    assert fed(adapter, run, range(16, 17))[0].adapted


def test_a_quaternion_with_rounding_is_the_same_attitude(run):
    ours, theirs = (Adapter(vehicle(), "sgd", watch=False) for _ in range(2))
    fed(ours, run, range(20))
    fed(theirs, replace(run, quaternion=run.quaternion * 1.01), range(20))
    assert torch.allclose(parameters(ours), parameters(theirs), rtol=1e-9, atol=1e-12)
