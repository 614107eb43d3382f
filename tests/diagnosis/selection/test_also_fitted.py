"""Which effects are fitted besides those that lead by their tests."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection import choose
from auvnn.diagnosis.selection.also_fitted import promising, rivals_to_fit
from auvnn.diagnosis.selection.choose import Choice, Chooser


def scored(name, gain, degrees):
    nothing = np.zeros(degrees)
    return Score(name, 1e-4, gain, degrees, 1.0, nothing, nothing, -20.0, gain)


def test_what_might_fit_better_than_the_one_in_the_lead_is_tried_however_many_parameters_it_has():
    leader = scored("net_buoyancy", 14.0, 1)
    clear, chance, more = (
        scored("thruster_gain", 44.0, 8),
        scored("constant_force", 28.0, 6),
        scored("payload", 42.0, 8),
    )
    assert promising([leader, clear, chance, more], [leader]) == [clear]
    assert promising([leader, chance], [leader]) == [], (
        "14 more by six parameters are chance in three of a hundred"
    )
    assert promising([leader, clear], [leader, clear]) == [] == promising([clear], [])


def fit(effect: str, cost: float) -> Any:
    return SimpleNamespace(effects=(effect,), fitted=SimpleNamespace(cost=cost))


def score(effect: str, gain: float, evidence: float) -> Any:
    return SimpleNamespace(effect=effect, gain=gain, evidence=evidence)


@pytest.mark.parametrize(
    ("fell", "fitted"),
    [
        # The slopes at the null say what a fit takes away, within a factor of 1.5: they rank the effects. The lag is the
        # plainer cause, a special case of the overshoot, and is fitted in any case.
        (100.0, ["thruster_lag"]),
        (140.0, ["thruster_lag"]),
        (70.0, ["thruster_lag"]),
        # They say little of it: what else is confused with it is fitted too.
        (160.0, ["thruster_lag", "added_mass"]),
        (60.0, ["thruster_lag", "added_mass"]),
    ],
)
def test_where_slopes_say_little_what_is_confused_with_the_best_is_fitted_too(fell, fitted):
    significant = [
        score("thrust_overshoot", 100.0, 90.0), score("payload", 80.0, 50.0), score("waves", 30.0, 20.0),
        score("added_mass", 30.0, 8.0), score("thruster_lag", 20.0, 9.0),
    ]  # fmt: skip
    tried = [fit("payload", 950.0), fit("thrust_overshoot", 1000.0 - fell)]
    current = fit("", 1000.0)
    assert [s.effect for s in rivals_to_fit(tried, significant, current)] == fitted
    assert rivals_to_fit([], significant, current) == []


@pytest.mark.parametrize(
    ("fell", "fitted"),
    [
        (100.0, ["trapped_water"]),
        # Two others that are confused with it have more evidence; they do not take the plainer cause's place.
        (40.0, ["trapped_water", "turning_forces", "thruster_gain"]),
    ],
)
def test_one_mass_is_fitted_beside_six_factors_of_the_added_mass(fell, fitted):
    significant = [
        score("added_mass", 100.0, 90.0), score("turning_forces", 80.0, 50.0), score("thruster_gain", 60.0, 40.0),
        score("trapped_water", 50.0, 3.0),
    ]  # fmt: skip
    tried = [fit("added_mass", 1000.0 - fell)]
    assert [s.effect for s in rivals_to_fit(tried, significant, fit("", 1000.0))] == fitted
    # The plainer cause in the lead has no rival that has to be fitted but by its slopes.
    found = rivals_to_fit([fit("trapped_water", 950.0)], significant, fit("", 1000.0))
    assert found == []


@pytest.mark.parametrize(
    ("leader", "plainer", "other"),
    [
        ("body_lift", "munk_moment", "coupled_damping"),
        ("constant_force", "net_buoyancy", "ocean_current"),
        ("constant_force", "cg_offset", "ocean_current"),
    ],
)
def test_the_plainer_cause_of_what_leads_is_fitted_however_little_its_slope_says(leader, plainer, other):
    """The slopes rank the effects here: what is confused with the one in the lead and no plainer is not fitted."""
    significant = [score(leader, 100.0, 90.0), score(other, 60.0, 50.0), score(plainer, 10.0, 5.0)]
    told = rivals_to_fit([fit(leader, 900.0)], significant, fit("", 1000.0))
    assert [s.effect for s in told] == [plainer]


def test_what_is_fitted_besides_is_weighed_with_those_that_lead(monkeypatch):
    leads, more = scored("added_mass", 44.0, 6), scored("trapped_water", 14.0, 1)
    asked: list[Any] = []

    def fitted(beside: Any, scores: Any, *_: Any) -> Any:
        return [f"fit of {s.effect}" for s in scores], {}

    def besides(tried: Any, significant: Any, current: Any) -> Any:
        asked.append((list(tried), [s.effect for s in significant], current))
        return [more]

    monkeypatch.setattr(choose, "fitted_beside", fitted)
    monkeypatch.setattr(choose, "rivals_to_fit", besides)
    monkeypatch.setattr(Chooser, "_among", lambda self, tried, *_: Choice("unknown", None, tried, []))
    # Only the first one leads.
    monkeypatch.setattr(choose, "LEADERS", 1)
    nothing: Any = None
    chooser = Chooser(nothing, nothing, print)
    scores = {s.effect: s for s in (leads, more)}
    found = chooser.choose(scores, nothing, [], [], nothing)
    assert found.tried == ["fit of added_mass", "fit of trapped_water"]
    assert asked == [(["fit of added_mass"], ["added_mass", "trapped_water"], None)]
