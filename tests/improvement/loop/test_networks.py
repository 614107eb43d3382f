"""Damping subnetworks as a step of the loop: taken where drag is of no polynomial's shape, judged by unseen folds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.improvement.loop import learned, networks
from auvnn.improvement.loop.improve import Walk
from auvnn.improvement.loop.state import ALL, banked
from auvnn.models import GreyBox, load, save
from auvnn.models.actuation.command_path import CommandPath, with_commands
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def walk(model):
    """A log of a vehicle whose drag has a bump in surge and in sway that no stated coefficient can give."""
    bank = DampingBank.from_description("mlp", 3)
    with torch.no_grad():
        bank.input_scale.copy_(torch.tensor([0.15, 0.15, 0.3, 0.3, 0.3, 0.3]))
        bank.output_scale.copy_(torch.tensor([30.0, 30.0, 0.0, 0.0, 0.0, 0.0]))
    truth = GreyBox(model.vehicle, (), bank, model.actuation)
    found = Walk(model, make_log(truth, runs=4, duration=30.0, noise=0.3), None, [], 1, 1e4, None, None)
    found.refit()
    found.learn("mlp")
    return found


def test_subnetworks_are_taken_where_drag_has_their_shape(walk, tmp_path):
    step = walk.steps[-1]
    assert step.step == "mlp" and step.kind == "learned" and step.after < 0.8 * step.before
    assert walk.state.model.damping is not None
    save(walk.state.model, tmp_path / "model")
    assert load(tmp_path / "model").damping is not None


def test_each_fold_is_judged_by_networks_that_have_not_seen_it(walk):
    banks = walk.state.recipe.banks
    assert set(banks) == {ALL, *walk.judge.folds.numbers}
    nu = torch.tensor(np.random.default_rng(0).normal(0, 0.2, (50, 6)))
    given = [banks[f](nu) for f in walk.judge.folds.numbers]
    assert all(not torch.allclose(a, b) for a, b in pairwise(given))
    fold = walk.judge.folds.numbers[1]
    own = banked(walk.model, walk.state.recipe, fold).damping
    assert own is not None and torch.equal(own(nu), banks[fold](nu))


def test_a_model_with_subnetworks_states_how_commands_go_as_before(walk):
    path = CommandPath("linear", 0.5, 0.1)
    made = networks._with(with_commands(walk.state.model, path), walk.state.recipe.banks[ALL])
    assert made.commands == path


def test_nothing_is_taken_where_drag_is_as_stated(model):
    walk = Walk(model, make_log(model, runs=4, duration=12.0, noise=1.0), None, [], 1, 1e4, None, None)
    walk.refit()
    before = len(walk.steps)
    walk.learn("mlp")
    assert len(walk.steps) == before and walk.tried[-1].step == "mlp"
    assert walk.state.model.damping is None


def test_a_model_that_has_subnetworks_keeps_them(model):
    bank = DampingBank.from_description("polynomial", 0)
    given = GreyBox(model.vehicle, (), bank, model.actuation)
    walk = Walk(given, make_log(model, runs=4, duration=8.0, noise=1.0), None, [], 1, 1e4, None, None)
    walk.learn("mlp")
    assert walk.steps == [] and walk.tried == []


def test_learned_terms_are_predicted_within_their_bounds(model, monkeypatch):
    """What a term promises beyond its bounds cannot be had: its scale is held to a hundredth of what is needed."""
    truth = model.with_effects({"net_buoyancy": {"force": 8.0}})
    walk = Walk(model, make_log(truth, runs=3, duration=12.0, noise=0.3), None, [], 1, 600.0, None, None)
    walk.refit()
    begin = walk._before() or walk.state
    free = max(c.fall for c in learned.choose(walk.model, walk.judge, begin, "residual_force"))
    inside = learned.limits

    def narrow(model, names, held):
        low, high = (x.copy() for x in inside(model, names, held))
        at = 0
        for name in names:
            count = len(model.effect(name).parameters_of)
            if name == "residual_force":
                low[at : at + count], high[at : at + count] = -1e-4, 1e-4
            at += count
        return low, high

    monkeypatch.setattr(learned, "limits", narrow)
    held = [c.fall for c in learned.choose(walk.model, walk.judge, begin, "residual_force")]
    assert free > 0.05 and max(held, default=0.0) < 0.5 * free


def test_its_form_is_among_the_kinds():
    assert networks.FORM in learned.KINDS
