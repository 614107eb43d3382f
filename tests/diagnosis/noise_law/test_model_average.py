"""What lies between explanations, against the mean over draws of explanation and value."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.model_average import averaged
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAMES = ["net_buoyancy", "ocean_current"]


@pytest.fixture(scope="module")
def world() -> Any:
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), noise=1.0)
    layout = lay_out(model, NAMES)
    windows, base = windows_for(model, log), list(layout.nuisance)
    return SimpleNamespace(layout=layout, of=lambda names: fit_hypothesis(layout, windows, base, names))


def as_hypothesis(explanation: FittedHypothesis, evidence: float) -> Any:
    return SimpleNamespace(explanation=explanation, evidence=evidence, name=explanation.effects[-1])


def moved(found: FittedHypothesis, step: float) -> FittedHypothesis:
    return replace(found, fitted=replace(found.fitted, theta=found.fitted.theta + step))


def test_what_lies_between_is_the_spread_of_draws_about_what_is_answered(world):
    named, both = world.of(["net_buoyancy"]), world.of(["ocean_current", "net_buoyancy"])
    current = as_hypothesis(named, 10.0)
    rivals = [as_hypothesis(moved(both, 0.4), 11.0), as_hypothesis(moved(both, -0.1), 9.0)]
    told = averaged(world.layout, current, rivals)
    at = world.layout.places(named.names)["net_buoyancy"]
    theirs = world.layout.places(both.names)["net_buoyancy"]
    values = [named.fitted.theta[at[0]], *(r.explanation.fitted.theta[theirs[0]] for r in rivals)]
    weight = np.exp([10.0, 11.0, 9.0])
    random = np.random.default_rng(1)
    draws = random.choice(values, size=200000, p=weight / weight.sum())
    assert told.systematic is not None and told.systematic.shape == named.fitted.theta.shape
    assert told.systematic[at[0]] == pytest.approx(np.sqrt(np.mean((draws - values[0]) ** 2)), rel=0.02)
    before, after = (standard_errors(e, at)[0] for e in (named, told))
    assert after[0] == pytest.approx(np.hypot(before[0], told.systematic[at[0]]))


def test_what_the_data_refute_and_nothing_else_changes_nothing(world):
    named, both = world.of(["net_buoyancy"]), world.of(["net_buoyancy", "ocean_current"])
    current = as_hypothesis(named, 0.0)
    at = world.layout.places(named.names)["net_buoyancy"]
    plain = standard_errors(named, at)[0]
    for rivals in ([], [as_hypothesis(moved(both, 5.0), -60.0)]):
        told = averaged(world.layout, current, rivals)
        np.testing.assert_allclose(standard_errors(told, at)[0], plain, rtol=1e-6)


def test_what_no_fit_tells_of_a_delay_stays_part_of_it(world):
    named, both = world.of(["net_buoyancy"]), world.of(["net_buoyancy", "ocean_current"])
    own = np.full(len(named.fitted.theta), 0.3)
    current, rivals = as_hypothesis(named, 0.0), [as_hypothesis(moved(both, 0.4), 0.0)]
    plain = averaged(world.layout, current, rivals).systematic
    told = averaged(world.layout, as_hypothesis(replace(named, systematic=own), 0.0), rivals).systematic
    np.testing.assert_allclose(told, np.hypot(plain, own))
