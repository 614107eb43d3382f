"""Fits that no step leads on, begun again from parts of their windows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import auvnn
from auvnn.diagnosis.cross_validation.fitters import started
from auvnn.diagnosis.hypotheses import parts_first
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.outlier_restart import gain
from auvnn.diagnosis.hypotheses.parts_first import better_from_parts
from auvnn.diagnosis.hypotheses.stated_priors import lay_out, priors
from auvnn.estimation import prediction_error
from auvnn.estimation.prediction_error import fit
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

OFFSET = {"fin_1": 0.15, "fin_2": 0.157, "fin_3": -0.194, "fin_4": -0.45}


@pytest.fixture(scope="module")
def turning_over():
    """A vehicle whose fins are far off, and the fit without them, which leaves it turning over in its first windows."""
    model = auvnn.load("remus100")
    log = auvnn.simulate(
        model, "multisine", hidden={"fin_offset": OFFSET}, duration=40.0, rate=10.0, runs=4, seed=2, noise="realistic"
    ).log  # fmt: skip
    layout = lay_out(model, ["fin_offset"])
    windows = windows_for(model, log)
    return layout, windows, fit_hypothesis(layout, windows, list(layout.nuisance), ())


def test_a_step_that_promises_much_and_brings_nothing_leaves_a_fit_stuck(turning_over):
    layout, windows, first = turning_over
    names = (*layout.nuisance, "fin_offset")
    known = priors(layout, names, free=["fin_offset"])
    begun = started(layout, first, names).model
    best = fit(begun, windows, names, known, initial=first.fitted.initial, iterations=15)
    assert best.stuck and not best.converged
    again = better_from_parts(best, windows, names, known, sigma=None, iterations=15)
    assert gain(best, again, None) > 0.0
    assert float(np.abs(again.theta[-4:] - list(OFFSET.values())).max()) < 0.5 * float(
        np.abs(best.theta[-4:] - list(OFFSET.values())).max()
    )


def settled():
    """A fit that has settled, its windows, the effects that were free, and what is known of them."""
    model = GreyBox(small_vehicle())
    log = make_log(model, runs=2, duration=20.0, noise=1.0)
    layout, windows = lay_out(model, []), windows_for(model, log)
    names = tuple(layout.nuisance)
    known = priors(layout, names)
    found = fit(layout.model, windows, names, known)
    return found, windows, names, known


def test_a_fit_that_settles_is_not_stuck_and_stays():
    found, windows, names, known = settled()
    assert found.converged and not found.stuck
    assert better_from_parts(found, windows, names, known, sigma=None, iterations=15) is found


def test_a_promise_that_is_next_to_nothing_leaves_no_fit_stuck(monkeypatch):
    """Near the minimum rounding may be all that a step could bring."""
    found, windows, names, known = settled()
    real = prediction_error._answered

    def none_lower(*args: Any) -> Any:
        return None if len(args) > 4 else real(*args)

    monkeypatch.setattr(prediction_error, "_answered", none_lower)
    monkeypatch.setattr(prediction_error, "LITTLE", -1e9)
    ended = fit(found.model, windows, names, known, initial=found.initial, sigma=found.sigma)
    assert not ended.converged and not ended.stuck


@pytest.mark.parametrize("better", [True, False])
def test_the_better_one_is_returned(turning_over, monkeypatch, better):
    _, windows, first = turning_over
    stuck = replace(first.fitted, stuck=True)
    ends = [replace(first.fitted, sigma=first.fitted.sigma * (0.9 if better else 1.1), stuck=False)] * 2
    asked: list[int] = []

    def fitted(_: Any, some: Any, *__: Any, **___: Any) -> Any:
        asked.append(len(some))
        whole = len(some) == len(windows)
        initial = ends[0].initial if whole else ends[0].initial.repeat_interleave(4, 0)[: len(some)]
        return replace(ends[0], initial=initial)

    monkeypatch.setattr(parts_first, "fit_with_outlier_restart", fitted)
    found = better_from_parts(stuck, windows, first.names, first.fitted.priors, sigma=None, iterations=3)
    assert asked[1:] == [len(windows)] and asked[0] > 3 * len(windows)
    assert found is stuck if not better else found.sigma[0] < stuck.sigma[0]
