"""What to drive next: the promise is held against full refits of data that one explanation makes."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.advise import Advice, advise
from auvnn.diagnosis.hypotheses.candidates import HORIZON, WARMUP, windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out, priors
from auvnn.estimation.prediction_error import fit
from auvnn.estimation.priors import Priors
from auvnn.models import GreyBox
from auvnn.simulation import manoeuvres as library
from auvnn.simulation import simulate
from auvnn.testing import plain_vehicle
from tests.diagnosis.strange_effects import HeavePush, listed
from tests.small_logs import make_log, sines

NAMES = ("net_buoyancy", "heave_push")
CUT = (HORIZON, WARMUP)


@pytest.fixture
def twins(monkeypatch):
    """A vehicle that never leaves the level, and two names for what pushes it up: along the world's z or its own."""
    listed(monkeypatch, HeavePush)
    # Fewer manoeuvres, for time.
    monkeypatch.setattr(library.manoeuvres, "__defaults__", (0, ("pulses", "rotation", "dives")))
    groups = ("added_mass", "linear_damping", "quadratic_damping", "inertia")
    vehicle = plain_vehicle(
        linear_damping=[25, 35, 40, 4, 5, 5],
        quadratic_damping=[40, 60, 80, 4, 5, 6],
        center_of_gravity=[0, 0, 0.04],
        uncertainty=dict.fromkeys(groups, 0.1),
    )
    model = GreyBox(vehicle, actuation="wrench")
    t = np.arange(0, 10.05, 0.1)
    command = sines(t, 6, 3) * [0, 0, 15.0, 0, 0, 3.0]
    truth = model.with_effects({"net_buoyancy": {"force": 6.0}})
    return model, make_log(truth, runs=3, duration=10.0, noise=1.0, command=command, stir=0.0)


def test_an_ambiguous_answer_says_what_to_drive_and_it_is_what_tilts_the_vehicle(twins):
    model, log = twins
    found = diagnose(model, log, [*NAMES, "thruster_lag"], whiteness=False)
    assert found.verdict == "ambiguous"
    after = found.to_dict()["next_experiment"]
    assert set(after["separates"]) == set(NAMES) and after["manoeuvre"] == "rotation"
    errors = {r["manoeuvre"]: r["standard_errors"] for r in after["ranking"]}
    assert len(errors) == 3 and errors["rotation"] == max(errors.values()) > 5
    assert after["standard_errors"] == errors["rotation"]
    assert "auvnn simulate excitation=rotation" in after["words"]
    # Driving it settles the question.
    made = simulate(
        model,
        "rotation",
        {"name": "realistic"},
        {"net_buoyancy": {"force": 6.0}},
        3,
        runs=1,
        duration=60.0,
        rate=10.0,
        max_step=0.05,
    )
    settled = diagnose(model, made.log, NAMES, whiteness=False)
    assert (settled.verdict, settled.missing) == ("named", ["net_buoyancy"])
    assert settled.next_experiment is None


@pytest.mark.long
def test_the_promise_is_what_a_full_refit_leaves(twins):
    """chi2 of the wrong explanation, refitted with its initial states, on noise-free data of the other one."""
    model, log = twins
    layout, windows = lay_out(model, NAMES), windows_for(model, log)
    rivals = [fit_hypothesis(layout, windows, layout.nuisance, (n,), iterations=6) for n in NAMES]
    promised = dict(advise(model, layout, rivals, CUT).ranking)
    right, wrong = rivals
    plan = next(p for p in library.manoeuvres(model, 60.0, 10.0) if p.name == "rotation")
    truth = right.fitted.model
    made = make_log(truth, runs=1, duration=60.0, command=plan.command, noise=0.0, stir=0.0)
    # Held about the values fitted so far, as the promise is, and iterated to the end instead of one linear step.
    stated = priors(layout, wrong.names, free=wrong.effects)
    held = Priors(wrong.fitted.theta, stated.precision)
    refitted = fit(wrong.fitted.model, windows_for(model, made), wrong.names, held, sigma=wrong.fitted.sigma)
    assert refitted.converged and promised["rotation"] > 5
    assert np.sqrt(refitted.cost) == pytest.approx(promised["rotation"], rel=0.1)


def test_without_advice_nothing_is_simulated(twins, monkeypatch):
    model, log = twins
    module = sys.modules["auvnn.diagnosis.answers.answering"]
    monkeypatch.setattr(module, "advise", None)
    assert diagnose(model, log, NAMES, advice=False, whiteness=False).next_experiment is None


def test_where_nothing_would_help_it_says_so():
    advice = Advice(("a", "b"), (("chirp", 1.2), ("dives", 0.3)))
    assert advice.words.startswith("No manoeuvre of the library would tell a and b apart")
    assert Advice(("a", "b"), ()).to_dict() is None
