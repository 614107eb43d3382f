"""Whiteness of what is left: silent where the model is true, loud where it is not, with bands of the right width."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.residuals.whiteness import residual_tests
from auvnn.models import GreyBox
from auvnn.report.panels import NoData
from auvnn.report.plots.residual_tests import residual_tests as drawn
from tests.small_logs import make_log, small_vehicle

CURRENT = {"ocean_current": {"v_north": 0.15, "v_east": -0.10}}


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def whiteness(model, log, names=()):
    layout = lay_out(model, names)
    windows = windows_for(model, log)
    return residual_tests(
        fit_hypothesis(layout, windows, layout.nuisance, names, iterations=6), windows, draws=400
    ), windows


@pytest.fixture(scope="module")
def true_model(model):
    return whiteness(model, make_log(model, runs=3, duration=20.0, noise=1.0, seed=5))


@pytest.fixture(scope="module")
def lacking(model):
    log = make_log(model.with_effects(CURRENT), runs=3, duration=20.0, noise=1.0, seed=5)
    return whiteness(model, log)[0], whiteness(model, log, ["ocean_current"])[0]


def test_a_true_model_leaves_its_bands_as_often_as_chance_does(true_model):
    found, _ = true_model
    auto = (found.auto < found.auto_low) | (found.auto > found.auto_high)
    cross = (found.cross < found.cross_low) | (found.cross > found.cross_high)
    # One in a hundred is nominal; neighbouring lags of a smooth command go out together.
    assert auto.mean() < 0.05 and cross.mean() < 0.08


def test_the_band_knows_that_initial_states_were_fitted(true_model):
    """Their fit takes the slow part out: the middle of the band lies below zero, where the textbook's does not."""
    found, windows = true_model
    assert (found.auto_low + found.auto_high < 0)[:, 0].all()
    # Textbook half-width for as many samples; the projection leaves fewer.
    textbook = 2.576 / np.sqrt(float(windows.mask[..., 6].sum()))
    half = 0.5 * (found.auto_high - found.auto_low)[:, 0]
    assert (half > 0.8 * textbook).all() and (half < 1.8 * textbook).all()


def test_what_is_missing_shows_and_is_gone_once_it_is_added(lacking):
    before, after = (r.to_dict() for r in lacking)
    assert before["autocorrelation"]["u"]["outside"] > 0.8 and before["autocorrelation"]["v"]["outside"] > 0.8
    assert after["autocorrelation"]["u"]["outside"] < 0.2 and after["autocorrelation"]["v"]["outside"] < 0.2


def test_a_wrong_thrust_shows_against_its_own_command(model):
    truth = model.with_effects({"thruster_gain": {f"thruster_{k}": 1.3 for k in range(1, 9)}})
    found = whiteness(model, make_log(truth, runs=3, duration=20.0, noise=1.0, seed=6))[0].to_dict()[
        "with_commands"
    ]
    for name, axis in zip("uvwpqr", "XYZKMN", strict=True):
        if found[name][axis]["bands"] > 1:
            return
    pytest.fail("no velocity's error goes with its own command")


def test_the_same_question_has_the_same_answer(model, true_model):
    again = whiteness(model, make_log(model, runs=3, duration=20.0, noise=1.0, seed=5))[0]
    np.testing.assert_array_equal(again.auto_low, true_model[0].auto_low)


def test_it_is_drawn_with_both_lines_and_their_band(lacking):
    before, after = (r.to_dict() for r in lacking)
    figure = drawn(before, after)
    panels = [a for a in figure.axes if a.lines]
    assert len(panels) == 6 and all(a.collections for a in panels)
    x, y = panels[0].lines[0].get_data()
    np.testing.assert_allclose(y, before["autocorrelation"]["u"]["value"])
    np.testing.assert_allclose(x, before["lags"])
    with pytest.raises(NoData):
        drawn({}, {})
