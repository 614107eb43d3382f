"""What a name leaves, asked of every measured input: found where it is, silent where nothing is, and who is needless."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.residuals.additive_force_test import AdditiveForce, additive_force_test
from auvnn.diagnosis.residuals.variance_component_test import Unnamed, white
from auvnn.models import GreyBox
from tests.diagnosis.strange_effects import HeadingForce
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def lifted(model):
    """A log with a hidden buoyancy."""
    return make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=12.0, noise=1.0)


def turned(model, force):
    """A model that is pushed sideways with twice its heading."""
    return model.rebuilt([HeadingForce.build(model.vehicle, "thrusters", {"force": force})])


def asked(model, log, names):
    windows, layout = windows_for(model, log), lay_out(model, names)
    base = list(layout.nuisance)
    fit = fit_hypothesis(layout, windows, base, tuple(names))
    return additive_force_test(fit, layout, windows, white(fit, np.zeros(18)), names, 0.01), fit, windows


def test_noise_alone_leaves_no_force_of_anything(model):
    """Of six logs at most one may come below a tenth; the smallest of a hundred tests is corrected for."""
    found = [
        asked(model, make_log(model, runs=2, duration=12.0, noise=1.0, seed=seed), [])[0].p_value
        for seed in range(6)
    ]
    assert sum(p < 0.1 for p in found) <= 1 and min(found) > 0.003


def test_a_name_is_needless_beside_the_force_that_it_stood_in_for_and_needed_for_its_own(model):
    log = make_log(
        turned(model, 6.0).with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=15.0, noise=1.0
    )
    found, _, _ = asked(model, log, ["net_buoyancy", "cg_offset"])
    assert (found.axis, found.input) == ("Y", "psi") and found.p_value < 1e-6
    # Of a force of the heading a shifted centre of gravity knows nothing, however much of it it had taken.
    assert found.needless == ("cg_offset",)


def told(monkeypatch, found, left=0.05, p_value=1.0):
    """As if a share of the force were left after the names, with a p-value, and the inputs said so."""

    def some_left(explanation, windows, sigma):
        energy = left if explanation.effects else 1.0
        return Unnamed(np.zeros(6), np.array([p_value / 6, *np.ones(5)]), energy * np.eye(6)[0], {"X": 1.0})

    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.variance_component_test", some_left)
    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.additive_force_test", lambda *_: found)


@pytest.mark.parametrize(
    ("p_value", "needless", "left", "missing", "nearest"),
    [
        (1e-4, ("net_buoyancy",), 0.05, [], ["net_buoyancy"]),
        (1e-4, (), 0.05, ["net_buoyancy"], []),
        (1e-4, (), 0.5, [], ["net_buoyancy"]),
        (0.02, ("net_buoyancy",), 0.5, ["net_buoyancy"], []),
    ],
)
def test_a_name_falls_where_it_is_needless_or_leaves_much(
    model, lifted, monkeypatch, p_value, needless, left, missing, nearest
):
    told(monkeypatch, AdditiveForce("K", "r", p_value, needless), left)
    found = diagnose(model, lifted, ["net_buoyancy"], advice=False, whiteness=False)
    assert (found.missing, found.nearest) == (missing, nearest)
    # A force that is beyond doubt is left whoever stands.
    assert found.steps[-1]["verdict"] in (("unknown", "partial") if p_value < 1e-3 else ("adequate",))


def test_one_of_two_names_that_is_needless_is_withdrawn_and_the_other_stands(model, monkeypatch):
    truth = model.with_effects({"net_buoyancy": {"force": 8.0}, "constant_force": {"X": 6.0}})
    log = make_log(truth, runs=2, duration=15.0, noise=1.0)
    names = ["net_buoyancy", "constant_force"]
    assert set(diagnose(model, log, names, advice=False, whiteness=False, stochastic=False).missing) == set(
        names
    )
    told(monkeypatch, AdditiveForce("X", "u", 1e-4, ("constant_force",)))
    found = diagnose(model, log, names, advice=False, whiteness=False, stochastic=False)
    assert found.missing == ["net_buoyancy"] and found.steps[-1]["verdict"] == "unknown"
    assert {"verdict": "withdrawn", "effects": ["constant_force"], "p_value": 1e-4} in found.steps
    (one,) = [c for c in found.candidates if c["effect"] == "net_buoyancy"]
    assert one["parameters"]["force"]["value"] == pytest.approx(8.0, abs=1.5)
