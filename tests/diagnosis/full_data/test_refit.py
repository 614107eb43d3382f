"""Standard errors of a fit to all parts of a long log: the same rules as for a fit in memory."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.full_data import full_data
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAMES = ["net_buoyancy", "actuation_delay"]


def test_what_lies_between_samples_counts_and_what_sums_cannot_have_told_has_no_standard_error(monkeypatch):
    model = GreyBox(small_vehicle())
    layout, windows = lay_out(model, NAMES), windows_for(model, make_log(model, noise=1.0))
    found = fit_hypothesis(layout, windows, list(layout.nuisance), NAMES, iterations=2)
    at, size = layout.places(found.names), len(found.fitted.theta)
    monkeypatch.setattr(full_data, "ratio", lambda *_: 1.0)
    monkeypatch.setattr(full_data, "slower_than_white", lambda *_: False)

    def told(hessian: np.ndarray, systematic: Any) -> np.ndarray:
        sums = SimpleNamespace(hessian=hessian, slope=np.zeros(size), windows=len(windows))
        for name in ("channel", "count", "rough", "pairs"):
            setattr(sums, name, None)
        passes: Any = SimpleNamespace(
            sums=lambda *_, **__: sums,
            moments=lambda point, asked, words: [SimpleNamespace(spread=lambda: None) for _ in asked],
        )
        asked: Any = replace(found, systematic=systematic)
        return full_data.refit(passes, layout, asked, None, None, np.zeros(18)).std  # type: ignore[arg-type]

    whole = found.fitted.statistics.total
    plain, delay = told(whole, None), at["actuation_delay"]
    assert found.systematic is not None
    wider = told(whole, found.systematic)
    interval = float(windows.times.diff(dim=-1).median())
    np.testing.assert_allclose(wider[delay], np.hypot(plain[delay], interval / np.sqrt(12.0)))
    np.testing.assert_allclose(np.delete(wider, delay), np.delete(plain, delay))
    assert np.isfinite(plain[at["net_buoyancy"]]).all()
    steep = whole.copy()
    steep[at["net_buoyancy"], at["net_buoyancy"]] *= 1e30
    value = found.fitted.theta[at["net_buoyancy"]]
    assert np.abs(value) > 0 and np.isnan(told(steep, None)[at["net_buoyancy"]]).all()
    assert plain[delay] == pytest.approx(told(steep, None)[delay], rel=0.5)
