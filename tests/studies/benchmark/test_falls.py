"""The share of the truth's fall of the held-out error that a found name reaches."""

from __future__ import annotations

import pytest

from auvnn.models import GreyBox
from auvnn.studies.benchmark import falls
from auvnn.studies.benchmark.falls import fall
from tests.small_logs import make_log, small_vehicle, thinned

NAME, FORCE = "net_buoyancy", 8.0


def test_the_truth_is_driven_as_the_model_that_is_fitted(monkeypatch):
    """Five ticks of a controller a sample: driven by held commands the truth itself errs by several times the noise."""
    model = GreyBox(small_vehicle())
    true = model.with_effects({NAME: {"force": FORCE}})
    log, held_out = (
        thinned(make_log(true, runs=3, duration=30.0, rate=25.0, noise=0.3, max_step=0.04, first=k), 5)
        for k in (0, 10)
    )
    found = fall(model, true, log, held_out, [NAME])
    assert found["share"] == pytest.approx(1.0, abs=0.05) and found["fault"] is None
    assert found["found"] == pytest.approx(found["true"], rel=0.25)
    assert true.commands is None
    # The truth alone, without what was found of the commands.
    monkeypatch.setattr(falls, "with_commands", lambda model, _: model)
    assert fall(model, true, log, held_out, [NAME])["true"] > 1.5 * found["true"]
