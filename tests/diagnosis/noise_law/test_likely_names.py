"""Which names the log prefers by enough, whatever they cost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law.hypothesis import explains_an_axis, predicts_better, shares_left
from auvnn.diagnosis.noise_law.rounds import names_given
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from tests.diagnosis.noise_law.stand_ins import given, with_law


def test_a_further_name_must_be_sure_in_the_mean_where_the_noise_is_white(monkeypatch):
    """A first name, and one beside noise that is not white, may also predict most windows better."""
    asked_for: list[tuple[float, bool]] = []

    def better(after, before, least, *, ranks):
        asked_for.append((least, ranks))
        return True

    monkeypatch.setattr(names_given, "predicts_better", better)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    for chosen, white in (([], True), (["tether"], True), (["tether"], False)):
        asked = given(tolerance=Tolerance.of(0), white_noise=white)
        at = Round(None, with_law((2.0, 2.0)), [], chosen)  # type: ignore[arg-type]
        asked.likely(at, 10, [with_law((0.1, 0.1), 50.0, "waves")], 4.0)  # type: ignore[list-item]
    further = names_given.GAIN_FURTHER
    assert asked_for == [(names_given.GAIN, True), (further, False), (further, True)] and further == 3.0


def test_what_is_likelier_and_known_to_be_confused_comes_first_though_it_predicts_less_surely(monkeypatch):
    sure = {"munk_moment", "tether"}
    monkeypatch.setattr(names_given, "predicts_better", lambda after, *_, **__: after.name in sure)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    at = Round(None, with_law((2.0, 2.0)), [], ["drag_curve"])  # type: ignore[arg-type]

    def said(*names):
        found: Any = [with_law((1.0, 1.0), 90.0 - k, name) for k, name in enumerate(names)]
        return [h.name for h in given().likely(at, 10, found, 4.0)]

    # What is not known to be confused with it, or is less likely, does not count.
    assert said("payload", "body_lift", "munk_moment", "tether") == ["body_lift", "munk_moment", "tether"]
    assert said("munk_moment", "body_lift") == ["munk_moment"]
    assert said("payload", "body_lift") == []


def test_what_is_likelier_and_known_to_be_confused_comes_first_though_more_is_asked_of_it(monkeypatch):
    """Odds of a hundred are enough where a name takes most of a force; what gains more than that needs no more either."""
    monkeypatch.setattr(names_given, "predicts_better", lambda *_, **__: True)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    at = Round(None, with_law((2.0, 2.0)), [], ["cg_offset"])  # type: ignore[arg-type]

    def said(*names):
        # Of these the body lift alone takes most of a force.
        found: Any = [
            with_law((0.1, 0.1) if name == "body_lift" else (1.9, 1.9), 90.0 - k, name)
            for k, name in enumerate(names)
        ]
        return [h.name for h in given().likely(at, 10, found, 200.0)]

    assert said("tether", "munk_moment", "body_lift", "turning_forces") == ["munk_moment", "body_lift"]
    assert said("munk_moment", "tether") == []


def test_a_force_left_is_that_of_the_mean_over_a_second():
    before, after = with_law((2.0, 4.0)), with_law((1.0, 4.0), time=0.125)
    # The mean over a second of what lasts an eighth: half of the rms.
    np.testing.assert_allclose(shares_left(after.estimate.law, before.estimate.law), [0.25 / 4.0, 0.25])
    np.testing.assert_allclose(shares_left(None, before.estimate.law), [0.0, 0.0])
    assert explains_an_axis(after, before) and not explains_an_axis(before, before)  # type: ignore[arg-type]


@pytest.mark.parametrize(("rms", "expected"), [((0.3, 2.0), ["waves"]), ((0.7, 2.0), [])])
def test_a_further_name_brings_much_of_the_gain_or_takes_the_force_of_an_axis(rms, expected, monkeypatch):
    monkeypatch.setattr(names_given, "predicts_better", lambda *_, **__: True)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    asked = given(tolerance=Tolerance.of(0))
    at = Round(None, with_law((2.0, 2.0)), [], ["tether"])  # type: ignore[arg-type]
    found = with_law(rms, 50.0, "waves")
    assert [h.name for h in asked.good(at, 10, [found], 100.0)] == expected  # type: ignore[list-item]
    # Or most of it where the names before it took less: here they took nothing of X, or all but a little.
    for before, more in (((2.0, 2.0), ["waves"]), ((20.0, 2.0), expected)):
        after = Round(None, at.current, [], ["tether"], null=with_law(before))  # type: ignore[arg-type]
        assert [h.name for h in asked.good(after, 10, [found], 100.0)] == more  # type: ignore[list-item]
        first = Round(None, at.current, [], [], null=with_law(before))  # type: ignore[arg-type]
        assert [h.name for h in asked.good(first, 10, [found], 100.0)] == expected  # type: ignore[list-item]
    # As much evidence as was asked for is enough by itself.
    assert asked.good(at, 10, [found], 40.0) == [found]  # type: ignore[list-item]


def test_runs_left_out_are_predicted_better_in_the_mean_or_in_most_windows(monkeypatch):
    random = np.random.default_rng(0)

    def better(gain, least=1.0, **how):
        monkeypatch.setattr("auvnn.diagnosis.noise_law.hypothesis.gain_by_window", lambda *_: gain)
        nothing = SimpleNamespace(weighed=None)
        return predicts_better(nothing, nothing, least, **how)  # type: ignore[arg-type]

    # An effect in few windows, and one in most of them whose mean three windows decide in which sensors are wrong.
    few = np.concatenate([0.1 * random.normal(size=90), 30.0 + random.normal(size=10)])
    most = np.concatenate([20.0 + 15.0 * random.normal(size=90), [-1700.0, -1500.0, -700.0]])
    assert better(few) and better(few, 2.0) and better(most) and better(most, 2.0)
    assert most.sum() < np.sqrt(len(most)) * most.std(ddof=1)
    assert better(few, ranks=False) and not better(most, ranks=False)
    # A few that gain very much hide no more what the others gain.
    large = np.concatenate([20.0 + 15.0 * random.normal(size=90), [90000.0, 5000.0, 3000.0]])
    assert large.sum() < 3.0 * np.sqrt(len(large)) * large.std(ddof=1) and better(large, 3.0, ranks=False)
    # Of what explains nothing one in a thousand does by its ranks.
    worse = [better(random.normal(size=100) - 0.1, 3.0) for _ in range(200)]
    assert sum(worse) <= 2
    assert not better(np.zeros(50)) and not better(np.full(50, np.nan))
