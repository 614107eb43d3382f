"""What stands behind the ranking one step ahead: slopes, what is left out, and everything else refitted."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.one_step import refit
from auvnn.diagnosis.one_step.rank import Ranked, _plainer_first
from auvnn.diagnosis.one_step.refit import OneStepRefit
from auvnn.diagnosis.one_step.slopes import AccelerationSlopes, extent_of_log
from auvnn.diagnosis.one_step.weighted_fit import FIFTHS, left_out, parts, solve, weights
from auvnn.metrics.derivative import Derivative, choose_derivative
from auvnn.metrics.one_step import accelerations
from auvnn.models import from_vehicle
from tests.small_logs import make_log, small_vehicle

MODEL = from_vehicle(small_vehicle())
HOW = Derivative("local_polynomial", 2, 2)


@pytest.fixture(scope="module")
def log():
    return make_log(MODEL, runs=2, duration=12.0, noise=0.3, max_step=0.05)


@pytest.mark.parametrize("name", ["actuation_delay", "thruster_lag", "net_buoyancy", "velocity_lever_arm"])
def test_slopes_are_those_of_models_built_anew(log, name):
    """Only what an effect touches is worked out again, and that must be all of it."""
    layout = lay_out(MODEL, [name])
    world = AccelerationSlopes(layout.model, log, HOW)
    here = world.gap()
    slopes = world.slopes([name], here)
    parameter = layout.described(name)[0]
    step = 0.25 * parameter.scale
    moved = MODEL.with_effects({name: {parameter.name: parameter.null + step}})
    base, there = (np.concatenate([accelerations(m, r, HOW)[1] for r in log.runs]) for m in (MODEL, moved))
    seen = np.isfinite(base).all(1)
    assert np.abs((there - base)[seen]).max() > 1e-6
    np.testing.assert_allclose(slopes[seen][..., 0], (there - base)[seen] / step, atol=1e-9)
    # And the parameters are where they were.
    np.testing.assert_allclose(world.gap()[seen], here[seen], atol=1e-12)


def test_what_is_left_out_was_not_fitted():
    """Against an ordinary ridge regression made five times, row by row."""
    random = np.random.default_rng(1)
    x = random.normal(size=(50, 6, 3))
    gap = x @ [1.0, -2.0, 0.5] + random.normal(size=(50, 6))
    precision, mean, weight = (
        np.array([0.1, 5.0, 0.0]),
        np.array([0.0, -1.0, 0.0]),
        random.uniform(0.5, 2, (50, 6)),
    )
    fifth = np.arange(50) * FIFTHS // 50
    found = left_out(gap, x, precision, mean, weight, fifth)
    for k in range(FIFTHS):
        rows, root = fifth != k, np.sqrt(weight[fifth != k]).ravel()
        a = np.vstack([x[rows].reshape(-1, 3) * root[:, None], np.diag(np.sqrt(precision))])
        b = np.concatenate([gap[rows].ravel() * root, np.sqrt(precision) * mean])
        theta = np.linalg.lstsq(a, b, rcond=None)[0]
        np.testing.assert_allclose(
            found[~rows], (weight[~rows] * (gap[~rows] - x[~rows] @ theta) ** 2).sum(1), rtol=1e-8
        )


def test_outliers_count_little():
    random = np.random.default_rng(2)
    x = random.normal(size=(400, 6, 1))
    gap = x[..., 0] * 2.0 + 0.1 * random.normal(size=(400, 6))
    gap[::20] += 30.0 * x[::20, :, 0]
    none = np.zeros(1)
    weight = weights(gap, x, none, none)
    # Errors grow with their weight's root and no faster: the estimate is pulled, but by a tenth of what it would be.
    assert abs(solve(gap, x, none, weight, none)[0] - 2.0) < 0.1
    assert abs(solve(gap, x, none, np.ones_like(gap), none)[0] - 2.0) > 1.0


def test_effects_that_the_model_has_are_refitted_too(log):
    """A model whose own effect is wrong by half must not find a candidate that only makes up for that."""
    true = make_log(
        MODEL.with_effects({"net_buoyancy": {"force": 8.0}}), duration=15.0, noise=0.3, max_step=0.05
    )
    wrong = MODEL.with_effects({"net_buoyancy": {"force": 4.0}})
    beside = OneStepRefit(wrong, true, choose_derivative(true))
    assert float(beside.refitted.effect("net_buoyancy").value("force").detach()) == pytest.approx(
        8.0, abs=0.5
    )
    point = beside.alone("constant_force")
    assert point is not None
    gain = np.nanmean(beside.before - point.after)
    assert gain < 0.02 * np.nanmean(beside.before)


def test_a_load_picked_up_on_the_way_is_found_at_its_time():
    """At its null the onset says nothing: it is asked for where it may be."""
    sure = from_vehicle(small_vehicle(uncertainty=0.0))
    heavier = sure.with_effects({"payload": {"time": 9.0, "mass": 4.0, "buoyancy": 0.0}})
    true = make_log(heavier, runs=2, duration=16.0, noise=0.3, max_step=0.08)
    beside = OneStepRefit(sure, true, choose_derivative(true))
    alone = beside.alone("payload")
    assert alone is not None and 7.0 <= alone.values["time"] <= 11.0
    whole = beside.alone("net_buoyancy")
    assert whole is not None and np.nanmean(alone.after) < np.nanmean(whole.after)
    both = beside.jointly("payload", alone)
    assert both.values["mass"] == pytest.approx(4.0, abs=1.5)
    assert both.values["time"] == alone.values["time"]


def test_a_log_reaches_from_its_first_sample_to_its_last(log):
    extent = extent_of_log(log)
    assert (
        extent.begin == 0.0
        and extent.duration == pytest.approx(12.0)
        and extent.longest == pytest.approx(12.0)
    )
    assert extent.distance[1] >= extent.distance[0] > 0.0
    block, fifth = parts(log)
    assert len(block) == log.samples and sorted(set(fifth)) == [0, 1, 2, 3, 4] and block.max() == 5


def test_of_those_that_are_tied_the_plainer_comes_first():
    def ranked(effect, after, behind):
        return Ranked(effect, 2.0, after, 0.1, {}, behind, 0.1)

    order = [ranked("payload", 1.0, 0.0), ranked("tether", 1.02, 0.02), ranked("net_buoyancy", 1.05, 0.05)]
    assert [r.effect for r in _plainer_first(order)] == ["net_buoyancy", "payload", "tether"]
    clear = [ranked("payload", 1.0, 0.0), ranked("net_buoyancy", 1.5, 0.5)]
    assert _plainer_first(clear) == clear and _plainer_first([]) == []


def test_a_step_that_is_too_long_is_shortened(monkeypatch):
    """Four times too long, each time: a quarter of it is taken, and the error falls as far as with the right one."""
    truth = MODEL.with_effects({"net_buoyancy": {"force": 12.0}})
    log = make_log(truth, runs=2, duration=20.0, noise=1.0)
    beside = OneStepRefit(MODEL, log, choose_derivative(log, None))
    found = beside.alone("net_buoyancy")
    real = refit.solve
    monkeypatch.setattr(refit, "solve", lambda *given: 4.0 * real(*given))
    again = beside.alone("net_buoyancy")
    assert found is not None and again is not None and found.fell > 0.0
    assert again.values["force"] == pytest.approx(found.values["force"], rel=0.02)
    assert again.fell == pytest.approx(found.fell, rel=0.02)
