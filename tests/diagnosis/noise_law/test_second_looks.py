"""Fits beside a stochastic force that are begun, or linearised, a second time: the better one stands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import relinearise, search
from auvnn.diagnosis.noise_law.relinearise import relinearised
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle

NAME, ESTIMATE = "net_buoyancy", 6.0


def explained(squared, at=None):
    """Return as much of an explanation as is looked at."""
    return SimpleNamespace(squared_error=lambda _: squared, at=at, fitted=None)


@pytest.mark.parametrize(
    ("ends", "begun", "best"),
    [
        # What lowers the errors stands; nothing further is tried.
        ((80.0,), (1.0,), 80.0),
        # What raises them began too far off, and the better one stands, wherever it began.
        ((500.0, 90.0), (1.0, 0.1), 90.0),
        ((120.0, 130.0), (1.0, 0.1), 120.0),
        # A fit that fails is no fit.
        ((None, 95.0), (1.0, 0.1), 95.0),
        ((None, None), (1.0, 0.1), None),
    ],
)
def test_a_fit_with_larger_errors_than_without_is_begun_nearer_the_null(monkeypatch, ends, begun, best):
    layout = lay_out(GreyBox(small_vehicle()), [NAME])
    seen = []

    def fitted(*_, guess, **__):
        seen.append(parameters_of(guess.model, [NAME])[0])
        if (end := ends[len(seen) - 1]) is None:
            raise FitError("no")
        return explained(end)

    monkeypatch.setattr(search, "fit_hypothesis", fitted)
    asked: Any = object.__new__(ForceSearch)
    asked.layout, asked.windows, asked.weights, asked.say = layout, None, np.ones(18), lambda _: None
    score: Any = SimpleNamespace(estimate=np.array([ESTIMATE]))
    current: Any = SimpleNamespace(explanation=explained(100.0))
    found = asked._one(NAME, score, layout, current, [], [])
    assert seen == pytest.approx([share * ESTIMATE for share in begun])
    assert (None if found is None else found.squared_error(None)) == best


@pytest.mark.parametrize(
    ("worth", "ends"),
    [
        # Of the whole step, of 0.3 of it: evidence beyond that of the hypothesis as it was.
        ((0.0, None), 1.0),
        ((-1.1 * ODDS, 1.0), 0.3),
        ((None, 1.0), 0.3),
        ((-1.1 * ODDS, -1.1 * ODDS), 0.0),
    ],
)
def test_a_hypothesis_goes_as_far_with_its_law_as_does_not_make_it_worse(monkeypatch, worth, ends):
    model = GreyBox(small_vehicle()).with_effects({NAME: {"force": 1.0}})
    values = dict(zip((1.0, 0.3), worth, strict=True))
    fitted = SimpleNamespace(theta=np.array([1.0]), model=model, initial=None)
    estimate = SimpleNamespace(law="law", step=np.array([4.0]))
    best: Any = SimpleNamespace(
        explanation=SimpleNamespace(fitted=fitted, names=[NAME]), estimate=estimate, evidence=7.0
    )
    monkeypatch.setattr(relinearise, "fit_initial_states", lambda *_: None)
    monkeypatch.setattr(relinearise, "_at", lambda found, windows, at, theta, initial: (at, theta))

    def judge(explanation, law):
        at, theta = explanation
        assert law == "law" and parameters_of(at, [NAME])[0] == theta[0]
        share = round((theta[0] - 1.0) / 4.0, 9)
        if values[share] is None:
            raise np.linalg.LinAlgError("grows without bound")
        return SimpleNamespace(evidence=7.0 + values[share], share=share)

    found: Any = relinearised(best, None, np.ones(18), judge)  # type: ignore[arg-type]
    assert found is best if ends == 0.0 else found.share == ends
