"""A model compared with what needs none: the regression is cross-validated on the log, and a loss is reported."""

from __future__ import annotations

import pytest

from auvnn.comparison import compare
from auvnn.comparison.baseline import words
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.regression import Regression
from auvnn.metrics.rollouts import scale_of, scored
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def made():
    model = GreyBox(small_vehicle())
    return model, make_log(model, runs=3, duration=15.0, noise=1.0)


def test_compare_holds_the_cross_validated_regression(made):
    model, log = made
    line = compare(model, log, horizons=["1", "5"]).to_dict()["baseline"]
    windows = cut_windows(log, 5.0, 2.5, kind="thrusters")
    found = Regression.of(log, "thrusters", choose_derivative(log, None))
    scale = scale_of(log)
    expected = scored(windows, found.predict(windows, left_out=True), scale)
    assert line["horizon"] == "5" and line["total"] == pytest.approx(expected.total(scale), rel=0.02)
    assert line["persistence"]["total"] > line["model"]["total"] and line["loses"] == {
        "baseline": [],
        "persistence": [],
    }


def test_a_model_that_is_far_off_is_told_that_it_loses(made):
    _, log = made
    wrong = GreyBox(small_vehicle(linear_damping=[2.0] * 6, quadratic_damping=[1.0] * 6, mass=200.0))
    line = compare(wrong, log, horizons=["5"]).baseline
    assert line["loses"]["baseline"]
    told = words(line)
    assert len(told) >= 2 and " the model is worse than the plain regression." in told[1]
    assert words({}) == []


def test_no_window_no_baseline(made):
    model, log = made
    assert compare(model, log, horizons=["full"]).to_dict()["baseline"] == {}
