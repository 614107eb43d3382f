"""Fits beside a stochastic force that are begun from several values: the likeliest stands."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import search, under_law
from auvnn.diagnosis.noise_law.rounds import leader_fits
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of
from auvnn.executors.serial import SERIAL
from auvnn.metrics.coloured_noise import NoiseColour
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

NAME, ESTIMATE = "net_buoyancy", 6.0


def begun_and_found(monkeypatch, ends, earlier=None, known=None, unseen=()):
    """Return where fits under the law began, and which of them stands, by the evidence in which they end."""
    monkeypatch.setattr(leader_fits, "within_record", lambda explanation, _: explanation not in unseen)
    layout, seen, reached = lay_out(GreyBox(small_vehicle()), [NAME]), [], [-100.0]

    def from_null(layout, model, current, base, effects, least):
        # What promises less than where an earlier beginning has led is not followed.
        assert least == max(reached)
        reached.extend(e for e in ends[len(seen) : len(seen) + 1] if e is not None)
        seen.append(parameters_of(model, [NAME])[0])
        assert effects == ["waves", NAME]
        if (end := ends[len(seen) - 1]) is None:
            raise FitError("no")
        return SimpleNamespace(evidence=end, explanation=end)

    fits: Any = SimpleNamespace(
        windows=None, from_null=from_null, settled=lambda h: h, judge=lambda e, law: e
    )
    looks = LeaderFits(layout, fits, lambda _: None)
    tested: Any = SimpleNamespace(scores={NAME: SimpleNamespace(estimate=np.array([ESTIMATE]))}, at=layout)
    current: Any = SimpleNamespace(estimate=SimpleNamespace(law="law"), evidence=-100.0)
    found = looks._one(NAME, Round(tested, current, [], ["waves"], earlier or {}), known)
    return seen, None if found is None else found.evidence


def test_a_fit_under_the_law_begins_where_the_effect_is_absent(monkeypatch):
    assert begun_and_found(monkeypatch, (-80.0,)) == ([0.0], -80.0)
    assert begun_and_found(monkeypatch, (None,)) == ([0.0], None)


def test_a_further_name_begins_where_it_was_found_as_the_first_one_too(monkeypatch):
    # A large effect is not where its slope points.
    earlier = {NAME: np.array([40.0])}
    assert begun_and_found(monkeypatch, (-80.0, -60.0), earlier) == ([0.0, 40.0], -60.0)
    assert begun_and_found(monkeypatch, (-80.0, None), earlier) == ([0.0, 40.0], -80.0)


def test_a_fit_begins_where_the_first_search_has_fitted_the_effect_too(monkeypatch):
    model = GreyBox(small_vehicle()).with_effects({NAME: {"force": 12.0}})
    known: Any = SimpleNamespace(fitted=SimpleNamespace(model=model))
    assert begun_and_found(monkeypatch, (-80.0, -60.0), known=known) == ([0.0, 12.0], -60.0)


def test_what_begins_before_the_log_does_is_not_found(monkeypatch):
    # The likelier end is a load that was there all along; the other one, if there is one, is picked up within the log.
    earlier = {NAME: np.array([40.0])}
    assert begun_and_found(monkeypatch, (-80.0, -60.0), earlier, unseen=[-60.0]) == ([0.0, 40.0], -80.0)
    assert begun_and_found(monkeypatch, (-80.0,), unseen=[-80.0]) == ([0.0], None)


def test_before_nothing_has_a_name_all_that_is_significant_is_fitted(monkeypatch):
    fitted = []

    worth = {"payload": -5.0, "waves": -7.0, "tether": None}

    def one(self, name, at, known):
        fitted.append(name)
        return None if worth[name] is None else SimpleNamespace(name=name, evidence=worth[name])

    monkeypatch.setattr(LeaderFits, "_one", one)
    nothing: Any = None
    scores = {
        "payload": (1e-9, 3.0), "waves": (1e-5, 9.0), "tether": (1e-9, 1.0), "flooding": (0.004, 20.0),
        "thruster_lag": (1e-9, 4.0),
    }  # fmt: skip
    tested: Any = SimpleNamespace(
        scores={n: SimpleNamespace(p_value=p, evidence=e, degrees=1) for n, (p, e) in scores.items()}
    )
    current: Any = "null"
    at, known = Round(tested, current, [], []), SimpleNamespace(name="thruster_lag", evidence=-6.5)
    looks: Any = LeaderFits(nothing, nothing, lambda _: None)
    found = looks.wider(at, [known], 0.01)
    # Of five that were asked for, one was fitted before, and the test of another one is not clear among five.
    assert fitted == ["waves", "payload", "tether"]
    assert [h.name for h in found] == ["payload", "thruster_lag", "waves"]
    # A second search that passes there again fits nothing twice, beside another explanation it does.
    assert [h.name for h in looks.wider(at, [known], 0.01)] == ["payload", "thruster_lag", "waves"]
    assert len(fitted) == 3
    looks.wider(replace(at, current="another"), [known], 0.01)
    assert len(fitted) == 6


@pytest.mark.parametrize(
    ("odds", "gain", "fitted"),
    [
        # Half of the gain against 0.3 of the odds, and against 90 where these are more than 300.
        (200.0, 118.0, False),
        (200.0, 122.0, True),
        (3000.0, 178.0, False),
        (3000.0, 182.0, True),
    ],
)
def test_a_further_name_is_fitted_where_its_test_promises_enough(monkeypatch, odds, gain, fitted):
    score = SimpleNamespace(degrees=1, evidence=0.5 * gain, gain=gain, p_value=1.0)
    asked: list[str] = []
    looks = LeaderFits(None, None, lambda _: None)  # type: ignore[arg-type]
    monkeypatch.setattr(LeaderFits, "_one", lambda self, name, at, known: asked.append(name))
    tested: Any = SimpleNamespace(scores={NAME: score})
    looks.leading(Round(tested, None, [], ["waves"]), [], odds, 0.01)  # type: ignore[arg-type]
    assert asked == [NAME] * fitted


@pytest.mark.parametrize(("chosen", "fitted"), [([], "abcghi"), (["waves"], "abcg")])
def test_effects_that_few_windows_tell_of_are_fitted_by_their_gain(monkeypatch, chosen, fitted):
    # The evidence falls from "a" to "i", the gain is largest for "g", then "h", "i" and "a".
    gains = dict(zip("abcdefghi", (300, 250, 240, 230, 220, 210, 900, 800, 700), strict=True))
    scores = {
        n: SimpleNamespace(degrees=1, evidence=-float(k), gain=float(gains[n]), p_value=1.0)
        for k, n in enumerate(gains)
    }
    asked: list[str] = []
    looks = LeaderFits(None, None, lambda _: None)  # type: ignore[arg-type]
    monkeypatch.setattr(LeaderFits, "_one", lambda self, name, at, known: asked.append(name))
    looks.leading(Round(SimpleNamespace(scores=scores), None, [], chosen), [], 10.0, 0.01)  # type: ignore[arg-type]
    assert "".join(sorted(asked)) == fitted


@pytest.mark.parametrize(
    ("lead", "chosen", "more"),
    [(250.0, [], True), (350.0, [], False), (-1.0, [], True), (250.0, ["waves"], False)],
)
def test_a_small_lead_is_none_before_more_effects_are_fitted(monkeypatch, lead, chosen, more):
    # Of ten significant effects the first three by evidence, which are so by gain too, lead; the likeliest is the last.
    scores: Any = {
        n: SimpleNamespace(degrees=1, evidence=-float(k), gain=900.0 - k, p_value=1e-9)
        for k, n in enumerate("abcdefghij")
    }
    worth = {"a": lead, "g": 500.0}

    def one(self, name, at, known):
        explanation = SimpleNamespace(effects=(name,))
        return SimpleNamespace(name=name, evidence=-1000.0 + worth.get(name, -5.0), explanation=explanation)

    monkeypatch.setattr(LeaderFits, "_one", one)
    monkeypatch.setattr(leader_fits, "rivals_of", lambda *given, **more: [])
    monkeypatch.setattr(leader_fits, "contained_in", lambda *_: {})
    looks = LeaderFits(None, None, lambda _: None)  # type: ignore[arg-type]
    at: Any = Round(SimpleNamespace(scores=scores), SimpleNamespace(evidence=-1000.0), [], chosen)  # type: ignore[arg-type]
    ahead = lambda found, odds: [h for h in found if h.evidence > -1000.0 + odds]  # noqa: E731
    found, good = looks.fitted(at, [], 4.6, 0.01, ahead)
    assert len(found) == (8 if more else 3)
    assert [h.name for h in good] == ["g"] * more + ["a"] * (lead > 0)
    # What was fitted beside another explanation is not among them.
    assert len(looks.fitted(at, [], 4.6, 0.01, ahead)[0]) == len(found)
    other = replace(at, current=SimpleNamespace(evidence=5000.0))
    assert len(looks.fitted(other, [], 4.6, 0.01, ahead)[0]) == (3 if chosen else 8)


def test_whether_commands_answer_is_asked_about_the_filtered_trajectories(monkeypatch):
    model = GreyBox(small_vehicle())
    log = wandering_log(model, np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5]), 1.0, runs=2, duration=20.0)
    layout, windows, about = lay_out(model, []), windows_for(model, log), []
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    asked: Any = SimpleNamespace(
        layout=layout, tolerance=None, usable=(), base=layout.names, say=lambda _: None, log=log, pool=SERIAL
    )
    monkeypatch.setattr(under_law, "in_closed_loop", lambda end, _: about.append(end.around) or True)
    beside = search.ForceSearch(asked, windows)
    null = beside.begin(first, white(first, np.full(18, 1e-9)))
    assert null is not None and beside.in_closed_loop and beside.names.in_closed_loop
    assert len(about) == 1 and about[0] is not None and about[0] is null.explanation.around
    # Of commands as they were read it was known before: what other laws make of them answers less.
    monkeypatch.setattr(under_law, "in_closed_loop", lambda end, _: False)
    for known in (True, False):
        beside = search.ForceSearch(asked, windows, closed_loop=known)
        assert beside.begin(first, white(first, np.full(18, 1e-9)), 0) is not None
        assert beside.in_closed_loop is known and beside.names.in_closed_loop is known
    coloured = replace(windows, noise=NoiseColour(np.full(18, 0.3)))
    assert beside.names.white_noise and not search.ForceSearch(asked, coloured).names.white_noise
