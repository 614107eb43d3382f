"""A load that was there all along is no load that is picked up."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.hypotheses.within_record import within_record
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.refit_leaders import Beside, fitted_beside
from auvnn.executors.serial import SERIAL
from auvnn.models import GreyBox
from auvnn.simulation import simulate
from tests.small_logs import small_vehicle

HEAVY = {"mass": 3.0, "buoyancy": 40.0, "x": 0.3, "z": 0.2}


@pytest.mark.parametrize(("time", "seen"), [(0.0, False), (9.0, True)])
def test_a_fit_that_begins_before_the_log_is_told_and_not_taken(time, seen):
    model = GreyBox(small_vehicle())
    made = simulate(
        model,
        hidden={"payload": {"time": time, **HEAVY}},
        runs=2,
        duration=20.0,
        rate=20.0,
        noise="realistic",
        seed=4,
    )
    layout, windows = lay_out(model, ["payload"]), windows_for(model, made.log)
    base = [n for n in layout.names if n != "payload"]
    null = fit_hypothesis(layout, windows, base, (), iterations=4)
    estimate = layout.means["payload"].copy()
    estimate[[0, 1, 2, 4, 5]] = max(time, 0.1), 2.0, 0.3, 0.2, 30.0
    asked = Beside(layout, windows, layout, base, [], null)
    test = Score("payload", 0.0, 900.0, 12, 1.0, estimate, np.ones(12), 400.0, 900.0)
    tried, failed = fitted_beside(asked, [test], SERIAL, lambda _: None)
    if seen:
        assert not failed and within_record(tried[0], windows)
        assert abs(float(tried[0].fitted.model.effect("payload").theta[0].detach()) - time) < 0.5
    else:
        assert not tried and "begins before the log" in failed["payload"]
    assert np.isfinite(null.fitted.cost)
