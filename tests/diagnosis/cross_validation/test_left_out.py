"""Errors on what is left out: against refits made one by one, and against what was hidden."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.cross_validation.errors import gain
from auvnn.diagnosis.cross_validation.folds import folds_of
from auvnn.diagnosis.cross_validation.left_out import each_name, left_out, left_out_by
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def world():
    known = GreyBox(small_vehicle(0.05))
    truth = known.with_effects({"constant_force": {"Y": 6.0}, "net_buoyancy": {"force": 3.0}})
    return known, make_log(truth, runs=4, duration=20.0, noise=1.0, seed=3)


def test_every_run_is_left_out_once_and_never_seen(world):
    _, log = world
    folds = folds_of(log)
    assert [r.number for f in folds for r in f.held.runs] == [r.number for r in log.runs]
    for fold in folds:
        assert not {r.number for r in fold.held.runs} & {r.number for r in fold.fit.runs}


def test_many_runs_are_left_out_in_groups_and_a_single_one_by_fifths(world):
    known, log = world
    assert len(folds_of(log, most=2)) == 2
    single = make_log(known, runs=1, duration=30.0)
    folds = folds_of(single)
    assert len(folds) == 5
    assert sum(f.held.samples for f in folds) == single.samples
    for fold in folds:
        seen = np.concatenate([r.t for r in fold.fit.runs])
        assert not np.isin(fold.held.runs[0].t, seen).any()


def test_each_name_earns_what_was_hidden(world):
    known, log = world
    found = each_name(known, log, ["constant_force", "net_buoyancy", "velocity_scale"])
    assert found.gains["constant_force"].beyond(2.0)
    assert "velocity_scale" not in [n for n, g in found.gains.items() if g.beyond(2.0)]
    assert found.jointly.value == pytest.approx(found.nothing.total - found.whole.total)
    assert found.gains["constant_force"].by_dof["v"][0] > 0.1
    assert found.whole.total < found.nothing.total < found.whole.persistence


def test_a_left_out_error_is_that_of_a_model_that_did_not_see_the_run(world):
    known, log = world
    nothing = left_out(known, log)
    scale = scale_of(log)
    by_hand = [roll(m, f.held, "5", scale) for m, f in zip(nothing.models, folds_of(log), strict=True)]
    squared = sum(r.squared.sum(0) for r in by_hand) / sum(r.count.sum(0) for r in by_hand)
    wanted = np.mean((np.sqrt(squared) / scale.std)[scale.excited])
    assert nothing.total == pytest.approx(wanted)


def test_one_newton_step_is_close_to_a_refit(world):
    known, log = world
    full = left_out(known, log, ["constant_force"])
    step = left_out(known, log, ["constant_force"], refit=False)
    assert step.total == pytest.approx(full.total, rel=0.02)
    assert "Newton" in step.how


def test_any_way_to_make_a_model_can_be_judged(world):
    known, log = world
    seen = []

    def make(part):
        seen.append({r.number for r in part.runs})
        return known

    given = left_out_by(make, log, names=["as given"])
    assert len(seen) == 4 and all(len(s) == 3 for s in seen)
    assert gain(given, given).value == 0.0

    def fails(part):
        raise FloatingPointError("nothing to be had")

    failed = left_out_by(fails, log)
    assert "nothing to be had" in failed.reason and failed.total == np.inf
    assert not gain(given, failed).beyond()


def test_fits_one_step_ahead_are_judged_by_free_running_too(world):
    known, log = world
    found = left_out(known, log, ["constant_force"], objective="one_step")
    assert found.total < left_out(known, log, objective="one_step").total
