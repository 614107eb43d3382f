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
        def look(self, name, _):
            asked.append(name)
            return of(gain, p_value=0.01)

        def near(self, name, _):
            raise AssertionError(name)

    monkeypatch.setattr(null_tests, "best_of", lambda seen: max(seen, key=lambda s: s.score.gain))
    tests: Any = object.__new__(NullTests)
    tests.layout, tests.windows, tests.extent = SimpleNamespace(nuisance=()), None, None
    tests.say = lambda _: None
    seen: Any = [SimpleNamespace(score=of(g)) for g in (*[3.0] * (STARTS - 1), gain)]
    search: Any = Search()
    found = tests._closer(search, {"payload": of(3.0), "waves": of(4.0)}, {"payload": seen})
    assert asked == list(found) == (["payload"] if looked else [])


@pytest.mark.parametrize(
    ("p_value", "gain", "looked"),
    [(1e-6, 100.0, True), (1e-6, 30.0, False), (0.5, 100.0, False)],
    ids=["it may lead", "it is far behind", "chance does as much"],
)
def test_a_shape_is_looked_at_more_closely_where_it_may_lead(p_value, gain, looked):
    """Of effects without levers: not where another one takes away more than three times as much, nor by chance."""
    asked = []

    class Search:
        def near(self, name, plain):
            asked.append(name)
            # What has no closer look, and what one does not find better, stays as it is.
            return {"waves": of(300.0), "tether": None}.get(name, plain)

    tests: Any = object.__new__(NullTests)
    search: Any = Search()
    told: Any = {"waves": of(gain, p_value), "net_buoyancy": of(200.0, 1e-9), "tether": of(150.0, 1e-9)}
    found = tests._closer(search, told, {})
    assert asked == [*(["waves"] if looked else []), "net_buoyancy", "tether"]
    assert {n: s.gain for n, s in found.items()} == ({"waves": 300.0} if looked else {})
