"""Learned drag never gives energy, whatever is learned: judged by the equation of motion, not by the limit's own code."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.damping.passive import passive
from auvnn.models import load
from auvnn.online import Adapter
from tests.online.online_world import driven, fed, vehicle, with_networks


def gained(model, nu) -> np.ndarray:
    """The power that a model's drag gives, W: nu . M nu_dot of the vehicle left to itself, without what g does.

    Coriolis forces do no work; nothing pushes; so what is left is drag. M is inverted from the unit accelerations.
    """
    nu = torch.tensor(np.array(nu))
    level = torch.tensor([0.0, 0, 5, 1, 0, 0, 0], dtype=torch.float64).expand(len(nu), 7)
    none = torch.zeros(len(nu), 6, dtype=torch.float64)
    with torch.no_grad():
        at_rest = model(level[:1], none[:1], none[:1])
        unit = model(level[:6], none[:6], torch.eye(6, dtype=torch.float64)) - at_rest  # rows: M^-1 e_i
        inertia = torch.linalg.inv(unit.mT)
        rate = model(level, nu, none)
    # g is what the vehicle does at rest, of which damping at rest, where the networks push, is taken out again.
    pushed = torch.zeros(6, dtype=torch.float64)
    if model.damping is not None:
        pushed = model.damping(torch.zeros(1, 6, dtype=torch.float64))[0].detach()
    restoring = inertia @ at_rest[0] + pushed
    return (nu * (rate @ inertia.mT - restoring)).sum(1).numpy()


@pytest.fixture(scope="module")
def reversed_thrusters():
    run = driven(vehicle(), duration=14.0, noise=(1e-3, 0.05))
    assert run.wrench is not None
    return replace(run, wrench=-run.wrench)


@pytest.mark.parametrize(("learner", "base"), [("rls", vehicle), ("sgd", vehicle), ("sgd", with_networks)])
def test_reversed_thrusters_teach_no_drag_that_gives_energy(reversed_thrusters, learner, base):
    adapter = Adapter(base(), learner, watch=False)
    updates = fed(adapter, reversed_thrusters)
    assert sum(u.adapted for u in updates) > 20
    visited = reversed_thrusters.nu
    everywhere = np.random.default_rng(0).uniform(-3.0, 3.0, (4000, 6))
    for model in (adapter.model, adapter.validated_model):
        for nu in (visited, everywhere, 1e-3 * everywhere):
            power = gained(model, nu)
            assert (power <= 1e-9 * (1.0 + np.abs(power).max())).all()
    if base is vehicle:
        # Without the limit these very weights would push the vehicle on: the test can fail.
        free = adapter.model
        assert free.damping is not None
        free.damping.passive = False
        assert (gained(free, everywhere) > 1.0).mean() > 0.01


def test_a_saved_model_and_a_restored_adapter_stay_passive(reversed_thrusters, tmp_path):
    adapter = Adapter(vehicle(), "sgd", watch=False)
    fed(adapter, reversed_thrusters, range(60))
    nu = np.random.default_rng(1).uniform(-3.0, 3.0, (500, 6))
    again = load(adapter.model.save(tmp_path / "model"))
    assert again.passive and np.array_equal(gained(again, nu), gained(adapter.model, nu))
    other = Adapter.restore(adapter.save(tmp_path / "state"))
    assert np.array_equal(gained(other.model, nu), gained(adapter.model, nu))
    ours, theirs = (fed(a, reversed_thrusters, range(60, 64)) for a in (adapter, other))
    for a, b in zip(ours, theirs, strict=True):
        assert a.unadapted_error is not None and torch.equal(a.unadapted_error, b.unadapted_error)
    text = (tmp_path / "model" / "model.yaml").read_text()
    assert "passive_drag: true" in text


def test_a_compiled_run_is_limited_as_well(reversed_thrusters, compiled_engine, monkeypatch):
    adapter = Adapter(vehicle(), "sgd", watch=False)
    fed(adapter, reversed_thrusters, range(60))
    model = adapter.model
    eta = torch.tensor([0.0, 0, 5, 1, 0, 0, 0], dtype=torch.float64)
    nu = torch.tensor([1.5, -1.0, 0.8, 0.5, -0.4, 0.9], dtype=torch.float64)
    times = torch.arange(21, dtype=torch.float64) * 0.1
    with torch.no_grad():
        fast = model.rollout(eta, nu, torch.zeros(21, 6).double(), times).nu
        monkeypatch.setenv("AUVNN_ENGINE", "torch")
        slow = model.rollout(eta, nu, torch.zeros(21, 6).double(), times).nu
    assert os.environ["AUVNN_ENGINE"] == "torch" and torch.allclose(fast, slow, rtol=1e-9, atol=1e-12)


def test_the_limit_is_the_projection_on_what_gives_no_energy():
    generator = torch.Generator().manual_seed(0)
    nu, learned, known = torch.randn(3, 500, 6, generator=generator, dtype=torch.float64)
    known = known.abs() * nu  # drag that takes energy
    weight = torch.tensor([100.0, 100, 120, 8, 8, 6], dtype=torch.float64)
    found = passive(8.0 * learned, known, nu, weight)
    before, after = (nu * (known + 8.0 * learned)).sum(-1), (nu * (known + found)).sum(-1)
    assert 50 < int((before < 0).sum()) < 450
    assert bool((after >= 0).all())
    kept = before >= 0
    assert torch.equal(found[kept], 8.0 * learned[kept])
    # Conditions of optimality: on the boundary, and the change along W nu (its multiplier is positive).
    moved, way = (found - 8.0 * learned)[~kept], weight * nu[~kept]
    assert float(after[~kept].abs().max()) < 1e-6
    ratio = moved / way
    assert bool((ratio > 0).all()) and torch.allclose(ratio, ratio[:, :1].expand_as(ratio), rtol=1e-9)


def test_drag_in_the_file_that_gives_energy_is_not_made_up_for():
    nu = torch.tensor([[1.0, 0, 0, 0, 0, 0]], dtype=torch.float64)
    known, learned = -5.0 * nu, -3.0 * nu
    found = passive(learned, known, nu, torch.ones(6, dtype=torch.float64))
    assert float((nu * (known + found)).sum()) == pytest.approx(-5.0, abs=1e-6)
    still = torch.zeros(1, 6, dtype=torch.float64)
    assert torch.equal(passive(learned, known, still, torch.ones(6).double()), learned)
