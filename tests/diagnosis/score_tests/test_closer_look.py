"""When a load is looked at more closely: where its joint test says more than the best of its starts by chance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from scipy.stats import chi2

from auvnn.diagnosis.score_tests import null_tests
from auvnn.diagnosis.score_tests.null_tests import ALPHA, NullTests

DEGREES, STARTS = 14, 8


def of(gain, p_value=0.5, evidence=0.0):
    return SimpleNamespace(gain=gain, degrees=DEGREES, p_value=p_value, evidence=evidence)


@pytest.mark.parametrize(("share", "looked"), [(0.5, True), (2.0, False)])
def test_the_starts_are_counted(monkeypatch, share, looked):
    """At half of the level it is looked at, at twice of it not, with eight starts and two effects."""
    gain = chi2.isf(share * ALPHA / (2 * STARTS), DEGREES)
    asked = []

    class Search:
        def __init__(self, *_: Any) -> None:
            pass

        def look(self, name, _):
            asked.append(name)
            return of(gain, p_value=0.01)

    monkeypatch.setattr(null_tests, "ShapeSearch", Search)
    monkeypatch.setattr(null_tests, "best_of", lambda seen: max(seen, key=lambda s: s.score.gain))
    tests: Any = object.__new__(NullTests)
    tests.layout, tests.windows, tests.extent = SimpleNamespace(nuisance=()), None, None
    tests.say = lambda _: None
    seen: Any = [SimpleNamespace(score=of(g)) for g in (*[3.0] * (STARTS - 1), gain)]
    found = tests._closer(None, None, [], [], {"payload": of(3.0), "waves": of(4.0)}, {"payload": seen})
    assert asked == list(found) == (["payload"] if looked else [])
