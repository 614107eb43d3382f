"""Fits under a law of the stochastic force: where their steps lead, and whether they find values that are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import law_fit
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis, judged
from auvnn.diagnosis.noise_law.law_fit import LawFits
from auvnn.diagnosis.noise_law.likelihood.estimate_law import estimate
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import force_sums
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.estimation.window_parts import split
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import make_log, small_vehicle

NAME = "net_buoyancy"


class Climb:
    """A log likelihood of one value whose slope promises another gain than a step brings.

    Args:
        of: the log likelihood.
        step: from a value to the step that is expected to lead to its top, and to what it promises.
    """

    def __init__(self, monkeypatch, of, step):
        self.of, self.step, self.seen = of, step, []
        model = GreyBox(small_vehicle()).with_effects({NAME: {"force": 0.0}})
        self.fitted = SimpleNamespace(theta=np.zeros(1), model=model, priors=None)
        monkeypatch.setattr(law_fit, "limits", lambda *_: (np.array([-50.0]), np.array([50.0])))
        monkeypatch.setattr(LawFits, "_at", lambda fits, found, theta: float(theta[0]))
        monkeypatch.setattr(LawFits, "_smoothed", lambda fits, found: None)

    def judge(self, value, law="law", held=True):
        assert law == "law"
        value = value.fitted.theta[0] if isinstance(value, SimpleNamespace) else value
        self.seen.append(value)
        if not np.isfinite(self.of(value)):
            raise np.linalg.LinAlgError("grows without bound")
        step, promised = self.step(value)
        estimate: Any = SimpleNamespace(law="law", step=np.array([step]), gain=2.0 * promised)
        fitted = SimpleNamespace(**{**vars(self.fitted), "theta": np.array([value])})
        explanation: Any = SimpleNamespace(names=[NAME], fitted=fitted, around=None)
        here = self.of(value)
        return Hypothesis(explanation, estimate, -2.0 * (here + promised), here + promised, 2.0 * promised)

    def settled(self, most=8):
        nothing: Any = None
        judge: Any = self.judge
        found = LawFits(nothing, np.ones(18), judge).settled(self.judge(0.0), most)
        return float(found.explanation.fitted.theta[0]), found.evidence


def test_steps_go_on_to_the_top(monkeypatch):
    climb = Climb(monkeypatch, lambda x: -((x - 8.0) ** 2), lambda x: (0.7 * (8.0 - x), (x - 8.0) ** 2))
    at, evidence = climb.settled()
    assert at == pytest.approx(8.0, abs=1.0) and evidence == pytest.approx(0.0, abs=1.0)
    assert len(climb.seen) < 7


def test_values_that_are_answered_go_on_to_the_top_as_far_as_steps_lead(monkeypatch):
    """Half a unit below the top decides no comparison, but is a standard error from the likeliest value."""
    climb = Climb(
        monkeypatch, lambda x: -0.5 * (x - 8.0) ** 2, lambda x: (0.7 * (8.0 - x), 0.5 * (x - 8.0) ** 2)
    )
    nothing: Any = None
    fits = LawFits(nothing, np.ones(18), climb.judge)  # type: ignore[arg-type]

    def at(found: Hypothesis) -> float:
        return float(found.explanation.fitted.theta[0])

    before = climb.judge(7.0)
    assert at(fits.settled(before)) == 7.0
    assert at(fits.closer(before)) == pytest.approx(8.0, abs=0.1)
    # Where it begins close it stays, and where no share of a step leads up as well.
    close = climb.judge(7.95)
    assert fits.closer(close) is close
    down = Climb(monkeypatch, lambda x: -abs(x), lambda x: (5.0, 300.0))
    stays = down.judge(0.0)
    assert LawFits(nothing, np.ones(18), down.judge).closer(stays) is stays  # type: ignore[arg-type]


def test_a_step_that_makes_the_values_unlikelier_is_shortened(monkeypatch):
    # Twelve times too far, each time: a tenth of the step is nearly right, the whole of it and 0.3 of it are not.
    climb = Climb(monkeypatch, lambda x: -((x - 2.0) ** 2), lambda x: (12.0 * (2.0 - x), (x - 2.0) ** 2))
    at, _ = climb.settled()
    assert at == pytest.approx(2.4) and climb.seen[1:4] == pytest.approx([24.0, 7.2, 2.4])
    climb = Climb(
        monkeypatch, lambda x: -np.inf if x > 5 else -((x - 2.0) ** 2), lambda x: (10.0, (x - 2.0) ** 2)
    )
    assert climb.settled()[0] in climb.seen


def test_what_a_step_promises_and_does_not_keep_is_no_evidence(monkeypatch):
    climb = Climb(monkeypatch, lambda x: -abs(x), lambda x: (5.0, 300.0))
    assert climb.settled() == (0.0, 0.0)
    # No share of it is tried again where the law stays what it was: begun, three shares, and the law asked once more.
    assert climb.seen == pytest.approx([0.0, 5.0, 1.5, 0.5, 0.0])


@pytest.mark.parametrize("kept", [True, False])
def test_values_stay_within_their_limits(monkeypatch, kept):
    climb = Climb(monkeypatch, lambda x: x if kept else -x, lambda x: (500.0, 500.0 - x))
    assert climb.settled(1)[0] == (50.0 if kept else 0.0)


def test_a_likelier_law_is_followed_though_its_worth_shows_only_after_a_step():
    """At the values before, a law with less of a force in it is unlikelier: the step that it promises comes first."""
    model = GreyBox(small_vehicle()).with_effects({NAME: {"force": 0.0}})

    def judge(value, law="wide", held=True):
        value = value.fitted.theta[0] if not isinstance(value, float) else value
        law = law if held else "narrow"
        top, height, width = (5.0, 0.0, 1.0) if law == "wide" else (10.0, 40.0, 0.2)
        here = height - (value - top) ** 2 / width
        promised = (value - top) ** 2 / width
        estimate: Any = SimpleNamespace(law=law, step=np.array([top - value]), gain=2.0 * promised)
        fitted = SimpleNamespace(theta=np.array([value]), model=model, priors=None)
        explanation: Any = SimpleNamespace(names=[NAME], fitted=fitted, around=None)
        return Hypothesis(explanation, estimate, -2.0 * (here + promised), here + promised, 2.0 * promised)

    nothing: Any = None
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(law_fit, "limits", lambda *_: (np.array([-50.0]), np.array([50.0])))
        patched.setattr(LawFits, "_at", lambda fits, found, theta: float(theta[0]))
        patched.setattr(LawFits, "_smoothed", lambda fits, found: None)
        found = LawFits(nothing, np.ones(18), judge).settled(judge(0.0))  # type: ignore[arg-type]
    assert found.evidence == pytest.approx(40.0) and found.explanation.fitted.theta[0] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("begun", "gains", "moves", "expected"),
    [
        # The law gains twice, then nothing: trajectories are looked at then, and not before.
        ("known", [50.0, 50.0], [], ["law", "law", "law", "look"]),
        # Free running is left at once, whatever the law would gain.
        (None, [50.0], ["their own"], ["look", "law", "law", "look"]),
        # New trajectories: the law is asked about them, and they are looked at again.
        ("known", [], ["their own"], ["law", "look", "law", "look"]),
        # A law that gains each time does not keep trajectories from being looked at.
        ("known", [50.0] * 9, [], ["law", "law", "law", "look"]),
        ("known", [50.0] * 9, ["their own"], ["law", "law", "law", "look"]),
    ],
)
def test_trajectories_are_looked_at_where_nothing_else_changes_any_more(
    monkeypatch, begun, gains, moves, expected
):
    asked, around, law_gains = [], list(moves), list(gains)

    def judge(explanation, law="law", held=True):
        gained = 0.0
        if not held:
            asked.append("law")
            gained = law_gains.pop(0) if law_gains else 0.0
        level = explanation.level + gained
        found: Any = SimpleNamespace(around=explanation.around, level=level)
        return Hypothesis(found, SimpleNamespace(law=law), -2.0 * level, level)  # type: ignore[arg-type]

    def smoothed(fits, found):
        asked.append("look")
        return SimpleNamespace(around=around.pop(0), level=found.explanation.level) if around else None

    monkeypatch.setattr(LawFits, "_smoothed", smoothed)
    nothing: Any = None
    found = LawFits(nothing, np.ones(18), judge).settled(judge(SimpleNamespace(around=begun, level=0.0)))  # type: ignore[arg-type]
    assert asked == expected
    assert found.explanation.around == (moves[-1] if moves else begun)
    assert found.evidence == sum(gains[: asked.count("law")])


RMS, TIME, HIDDEN = np.array([15.0, 15.0, 15.0, 1.5, 1.5, 2.0]), 1.0, 12.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_fit_from_the_null_finds_the_value_and_is_at_least_as_likely_as_one_of_output_errors(seed):
    truth = GreyBox(small_vehicle()).with_effects({NAME: {"force": HIDDEN}})
    log = wandering_log(truth, RMS, TIME, runs=3, duration=40.0, seed=seed)
    model = GreyBox(small_vehicle())
    (windows, *_), layout = split(windows_for(model, log), 2.0), lay_out(model, [NAME])
    base = ["added_mass", "linear_damping", "quadratic_damping", "inertia"]
    first = fit_hypothesis(layout, windows, base, (), iterations=4)
    sigma = white(first, np.zeros(18))

    def judge(explanation: FittedHypothesis, law, held=False):
        sums = force_sums(explanation, replace(windows, around=explanation.around), sigma)
        return judged(layout, explanation, sums, sigma, law, 0 if held else 40)

    law = estimate(Likelihood(force_sums(first, windows, sigma))).law
    assert law is not None
    fits = LawFits(windows, first.fitted.sigma, judge)
    null = fits.settled(judge(first, law))
    found = fits.from_null(layout, null.explanation.fitted.model, null, base, [NAME])
    at = layout.places(found.explanation.names)[NAME]
    value = float(found.explanation.fitted.theta[at[0]])
    std = float(np.sqrt(found.weighed.fitted.covariance()[at[0], at[0]]))
    assert abs(value - HIDDEN) < 3.0 * std < 0.5 * HIDDEN
    assert found.evidence > null.evidence + 20.0
    # At the end little is left to gain, and where a fit of output errors ends is no likelier.
    assert 0.5 * found.promised < 5.0
    plain = fit_hypothesis(layout, windows, base, [NAME], start=first.fitted, sigma=first.fitted.sigma)
    there = judge(replace(plain, around=found.explanation.around), law)
    assert found.evidence > there.here.evidence - 1.0


def test_a_fit_from_the_null_knows_what_no_fit_tells_of_a_delay(monkeypatch):
    model = GreyBox(small_vehicle())
    windows, layout = windows_for(model, make_log(model, duration=12.0)), lay_out(model, ["actuation_delay"])
    base = list(layout.nuisance)
    first, begun = fit_hypothesis(layout, windows, base, (), iterations=1), []
    current: Any = SimpleNamespace(estimate=SimpleNamespace(law=object()), explanation=first)
    fits = LawFits(windows, first.fitted.sigma, lambda explanation, law, held: begun.append(explanation))  # type: ignore[arg-type]
    monkeypatch.setattr(fits, "settled", lambda found, least: found)
    fits.from_null(layout, first.fitted.model, current, base, ["actuation_delay"])
    plain = fit_hypothesis(layout, windows, base, ["actuation_delay"], iterations=1)
    assert begun[0].systematic is not None and begun[0].systematic.tolist() == plain.systematic.tolist()
