"""Where the fit of an effect begins: off its null, and not so far off that it goes astray."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.refit_leaders import Beside
from auvnn.diagnosis.selection.refit_leaders import refitted as of_test
from auvnn.improvement import add
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def refitted(model, log, effect, estimate):
    """Return the fit of an effect begun from what a test is said to have estimated, and the fit without it."""
    layout, windows = lay_out(model, [effect]), windows_for(model, log)
    base = [n for n in layout.names if n != effect]
    current = fit_hypothesis(layout, windows, base, [])
    estimated = np.array(estimate)
    score = Score(effect, 0.0, 0.0, 1, 1.0, estimated, np.ones_like(estimated), 0.0, 0.0)
    return of_test(Beside(layout, windows, layout, base, [], current), score), current


def test_a_fit_that_goes_astray_is_begun_again_nearer_to_the_null(model):
    hidden = {"ocean_current": {"v_north": 0.1, "v_east": 0.05}}
    log = make_log(model.with_effects(hidden), runs=2, duration=8.0, noise=1.0)
    near, without = refitted(model, log, "ocean_current", [0.1, 0.05, 0.0])
    assert near.fitted.cost < without.fitted.cost - 100
    far, _ = refitted(model, log, "ocean_current", [4.0, -4.0, 4.0])
    assert far.fitted.cost < without.fitted.cost
    np.testing.assert_allclose(far.fitted.theta, near.fitted.theta, atol=0.02)


def test_a_lag_of_which_the_slope_knows_nothing_is_begun_where_there_is_one(model):
    """A lag of one two-hundredth of a sample: at the instant of a new command the acceleration is still the old one's."""
    lagging = model.with_effects({"thruster_lag": {"time_constant": 0.0005}})
    log = make_log(lagging, runs=3, duration=10.0, noise=1.0, accelerations=True)
    begun, without = refitted(model, log, "thruster_lag", [-0.002])
    stays, _ = refitted(model, log, "thruster_lag", [0.0])
    assert stays.fitted.theta[-1] == 0.0, "from its null no step leads on, or this says nothing"
    assert begun.fitted.theta[-1] > 0 and begun.fitted.cost < without.fitted.cost - 100
    # Who adds it by its name is answered alike.
    better = add(model, log, "thruster_lag")
    assert better.model.effect("thruster_lag").theta.item() > 0
