"""Coefficients that the log moves beyond what was stated of them are what is wrong, where nothing else is missing."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from scipy.stats import chi2

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.stages.beyond_stated import beyond_stated, departures
from auvnn.diagnosis.stages.state import State
from auvnn.effects import effect_class
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

# Two and a half of the stated standard deviations in each degree of freedom, which a fit follows, and less than one.
FAR, NEAR = 1.25, 1.08
NAMES = ["quadratic_damping", "linear_damping", "net_buoyancy", "thruster_lag"]


def model() -> GreyBox:
    return GreyBox(small_vehicle())


def truth(**factors: float) -> GreyBox:
    known = model()
    effects = []
    for name, value in factors.items():
        effect = effect_class(name).build(known.vehicle, known.actuation)
        with torch.no_grad():
            effect.theta.fill_(value)
        effects.append(effect)
    return known.rebuilt(effects)


def log_of(**factors: float):
    return make_log(truth(**factors), runs=3, duration=30.0, noise=0.5)


@pytest.fixture(autouse=True)
def nothing_found(monkeypatch):
    """A search for what is left finds nothing: what is uncertain has taken it up."""
    module = importlib.import_module("auvnn.diagnosis.diagnose")
    plain = module.search
    monkeypatch.setattr(
        module, "search", lambda asked, *given, **how: plain(replace(asked, most=0), *given, **how)
    )


def answer(log, **more):
    return diagnose(model(), log, NAMES, advice=False, whiteness=False, **{"costs": False, **more})


@pytest.fixture(scope="module")
def far():
    return log_of(quadratic_damping=FAR)


def test_a_group_beyond_what_is_stated_of_it_is_named_with_its_values(far):
    found = answer(far)
    assert answer(far, stochastic=False).missing == ["quadratic_damping"]
    assert found.verdict == "named" and found.missing == ["quadratic_damping"]
    assert [s["verdict"] for s in found.steps] == ["named", "adequate"]
    told = next(c for c in found.candidates if c["effect"] == "quadratic_damping")["parameters"]
    for axis in "XYZ":
        assert told[axis]["value"] == pytest.approx(FAR, abs=4.0 * told[axis]["std"])


def test_within_what_is_stated_nothing_is_missing():
    assert answer(log_of(quadratic_damping=NEAR)).missing == []


def test_what_chance_does_is_no_name_however_little_is_tolerated():
    """One and a half standard deviations in each of six degrees of freedom: one log in thirty has so much."""
    assert answer(log_of(quadratic_damping=1.15), tolerance={"cost": 1e-3}).missing == []


def test_names_that_were_found_and_what_is_unknown_stay():
    unasked: Any = None
    for change in ({"chosen": ("tether",)}, {"steps": ({"verdict": "unknown"},)}, {"steps": ()}):
        given: Any = {"windows": None, "first": None, "current": None, "steps": ({"verdict": "adequate"},)}
        state = State(**{**given, **change})
        assert beyond_stated(unasked, state) is state


@pytest.mark.parametrize("how", ["no fit", "no free running"])
def test_the_answer_stands_where_the_group_cannot_be_asked_for(far, monkeypatch, how):
    def unsolved(*_, **__):
        raise np.linalg.LinAlgError("singular")

    module = importlib.import_module("auvnn.diagnosis.stages.beyond_stated")
    if how == "no fit":
        monkeypatch.setattr(module, "fit_hypothesis", unsolved)
    else:
        monkeypatch.setattr(module, "roll", lambda *_: None)
    found = answer(far)
    assert found.verdict == "adequate" and found.missing == []


def test_it_is_not_named_where_it_hardly_changes_predictions(far):
    assert answer(far, tolerance={"cost": 1e3}).missing == []


def test_several_groups_that_move_together_are_no_name():
    assert "quadratic_damping" not in answer(log_of(quadratic_damping=FAR, added_mass=FAR)).missing


def test_departures_are_those_of_independent_normal_variables(far):
    known = model()
    layout, windows = lay_out(known, ["quadratic_damping"]), windows_for(known, far)
    found = fit_hypothesis(layout, windows, layout.names, ())
    own = layout.places(found.names)["quadratic_damping"]
    away = (found.fitted.theta[own] - 1.0) / 0.1
    assert departures(layout, found)["quadratic_damping"] == pytest.approx(chi2.sf(np.sum(away**2), 6))
    assert set(departures(layout, found)) == {"added_mass", "linear_damping", "quadratic_damping", "inertia"}
    free = fit_hypothesis(layout, windows, layout.names, ("quadratic_damping",))
    assert "quadratic_damping" not in departures(layout, free)


def test_it_costs_what_the_stated_values_do(far):
    """Followed by the fit, the group would take up its own name, and cost nothing."""
    found = answer(far, costs=True)
    assert found.nearest == []
    stated = roll(model(), far, "5", scale_of(far)).total(scale_of(far))
    right = roll(truth(quadratic_damping=FAR), far, "5", scale_of(far)).total(scale_of(far))
    # Less than with nothing refitted, for the other coefficients make up for a part within their own stated amounts.
    assert 1.0 < found.matters["quadratic_damping"]["cost"] < stated / right - 1.0
