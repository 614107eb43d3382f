"""A force without a name: the test against chance, against a force that is there, and what a diagnosis makes of it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers.words import tell
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.residuals.variance_component_test import (
    Unnamed,
    moment_matched_test,
    variance_component_test,
    white,
)
from auvnn.diagnosis.score_tests.null_tests import bonferroni
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.models import GreyBox
from tests.diagnosis.strange_effects import ClockForce
from tests.small_logs import make_log, small_vehicle

GROUPS = ("added_mass", "linear_damping", "quadratic_damping", "inertia")


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def pushed(model, force=8.0):
    """A model whose surge is pushed to the beat of a clock, which no effect of the catalogue does."""
    return model.rebuilt([ClockForce.build(model.vehicle, "thrusters", {"force": force})])


def asked(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    fit = fit_hypothesis(layout, windows, list(layout.names), ())
    return variance_component_test(fit, windows, white(fit, np.zeros(18))), fit, windows


def test_p_values_of_pure_chance_are_even():
    """Slopes drawn from the normal distribution that their information says, windows unlike one another."""
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(40, 7, 7)) * rng.uniform(0.2, 3.0, size=(40, 1, 1)) * np.linspace(2.0, 0.1, 7)
    hessian = roots @ roots.transpose(0, 2, 1)
    found = []
    for _ in range(600):
        slope = np.einsum("wij,wj->wi", roots, rng.normal(size=(40, 7)))
        found.append(moment_matched_test(slope, hessian))
    z, p_values, _ = (np.array(x) for x in zip(*found, strict=True))
    assert abs(z.mean()) < 0.15 and z.std() == pytest.approx(1.0, abs=0.1)
    assert stats.kstest(p_values, "uniform").pvalue > 0.01


def test_noise_alone_is_no_force_and_a_force_is_found_where_it_acts(model):
    left, fit, windows = asked(model, make_log(model, runs=2, duration=15.0, noise=1.0))
    assert left.p_value > 0.01 and np.abs(left.z).max() < 3.5
    there, _, _ = asked(model, make_log(pushed(model), runs=2, duration=15.0, noise=1.0))
    assert there.p_value < 1e-6 and next(iter(there.shares)) == "X"
    assert sum(there.shares.values()) == pytest.approx(1.0)
    assert there.shares["X"] > 0.9 and len(left.acts_in) == 1
    # The white part of the errors is the sensors' noise, whatever the slow part is.
    floor = np.full(18, 10.0)
    assert (
        np.isfinite(white(fit, np.zeros(18))).sum() >= 6
        and (white(fit, floor) >= 10.0).all()
        and len(windows) > 4
    )


def test_the_score_is_the_gain_that_a_small_force_has():
    """Of one window and one function the energy is that of a single chi-square."""
    z, p_value, energy = moment_matched_test(np.array([[3.0]]), np.array([[[1.0]]]))
    assert p_value == pytest.approx(stats.chi2.sf(9.0, 1)) and energy == pytest.approx(8.0)
    assert z == pytest.approx(8.0 / np.sqrt(2.0))
    assert moment_matched_test(np.zeros((2, 1)), np.zeros((2, 1, 1))) == (0.0, 1.0, 0.0)


def test_nothing_is_adequate_while_a_force_is_left(model):
    found = diagnose(
        model, make_log(pushed(model), runs=2, duration=15.0, noise=1.0), ["net_buoyancy", "thruster_lag"]
    )
    assert (found.verdict, found.missing, found.nearest) == ("unknown", [], [])
    assert next(iter(found.acts_in)) == "X" and any("It acts in surge (X)" in line for line in tell(found))
    assert found.global_p_value < 1e-3
    data = found.to_dict()
    assert data["acts_in"] == found.acts_in and data["nearest"] == []
    json.dumps(data, allow_nan=False)


def test_a_name_that_explains_a_part_predicts_and_is_not_the_cause(model):
    """A steady push besides: a constant force explains that, and is not what comes and goes."""
    truth = pushed(model, 12.0).with_effects({"constant_force": {"X": 8.0}})
    log = make_log(truth, runs=2, duration=15.0, noise=1.0)
    found = diagnose(model, log, ["constant_force"], whiteness=False, stochastic=False)
    assert (found.verdict, found.missing, found.nearest) == ("partial", [], ["constant_force"])
    assert found.steps == [{"verdict": "partial", "effects": [], "p_value": found.steps[0]["p_value"]}]
    # What the nearest leaves is what nothing in the catalogue explains.
    assert 0.1 < found.unexplained < 1.0
    assert any(line.startswith("constant_force predicts a part of what is missing") for line in tell(found))
    assert not any(line.startswith("Missing") for line in tell(found))
    one = found.joint["constant_force"]
    assert one["parameters"]["X"]["value"] == pytest.approx(8.0, abs=2.0)
    shares = one["explained_by_dof"]
    assert max(shares, key=shares.get) == "X" and 0.1 < shares["X"] < 0.9
    assert one["gain"]["value"] > one["gain"]["std"] > 0.0
    assert found.left["X"]["rms"] > 10 * found.left["X"]["detectable"]


@pytest.mark.parametrize(("p_value", "verdict"), [(0.005, "partial"), (0.02, "named")])
def test_a_name_is_refuted_on_weaker_grounds_than_adequacy(model, monkeypatch, p_value, verdict):
    """As if half of the force were left after the name, with a p-value between the two levels, or above both."""
    log = make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=12.0, noise=1.0)
    p_values = np.array([p_value / 6, *np.ones(5)])

    def half_left(explanation, windows, sigma):
        energy = 1.0 if explanation.effects else 2.0
        return Unnamed(np.zeros(6), p_values, np.array([energy, 0, 0, 0, 0, 0]), {"X": 1.0})

    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.variance_component_test", half_left)
    found = diagnose(model, log, ["net_buoyancy"], advice=False, whiteness=False, stochastic=False)
    assert found.verdict == verdict
    # Where what is left cannot be told from noise, no share of it is unexplained.
    assert (found.unexplained > 0.0) == (verdict == "partial")
    assert found.nearest == (["net_buoyancy"] if verdict == "partial" else [])


def test_what_names_predict_is_asked_once_and_last(model, monkeypatch):
    """A fit for each name is spent where the search beside a stochastic force has not answered already."""
    log = make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=12.0, noise=1.0)
    p_values, order = np.array([1e-3, *np.ones(5)]), []

    def half_left(explanation, windows, sigma):
        energy = 1.0 if explanation.effects else 2.0
        return Unnamed(np.zeros(6), p_values, np.array([energy, 0, 0, 0, 0, 0]), {"X": 1.0})

    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.variance_component_test", half_left)
    found = diagnose(
        model, log, ["net_buoyancy"], advice=False, whiteness=False, costs=False, progress=order.append
    )
    asked = [k for k, words in enumerate(order) if "asking what the names predict" in str(words)]
    white = [k for k, words in enumerate(order) if "noise is white" in str(words)]
    assert found.verdict == "partial" and len(asked) == 1 and white and white[0] < asked[0]


def test_a_withdrawn_name_is_not_among_the_nearest(model, monkeypatch):
    """A name that was taken first and withdrawn does not stand, whatever is left."""
    truth = pushed(model, 12.0).with_effects({"constant_force": {"X": 8.0}, "net_buoyancy": {"force": 6.0}})
    log = make_log(truth, runs=2, duration=15.0, noise=1.0)
    both = diagnose(
        model, log, ["constant_force", "net_buoyancy"], advice=False, whiteness=False, stochastic=False
    ).nearest
    assert set(both) == {"constant_force", "net_buoyancy"}

    def gone(self, taken, base):
        return fit_hypothesis(self.layout, self.windows, base, taken.effects[1:]), [taken.effects[0]]

    monkeypatch.setattr(Chooser, "withdrawn", gone)
    assert (
        diagnose(
            model, log, ["constant_force", "net_buoyancy"], advice=False, whiteness=False, stochastic=False
        ).nearest
        == both[1:]
    )


def test_a_further_effect_takes_a_clearer_test_than_the_first(model, monkeypatch):
    log = make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=15.0, noise=1.0)
    asked_for: list[float] = []

    def doubtful(p_values):
        asked_for.append(bonferroni(p_values))
        return asked_for[0] if len(asked_for) == 1 else 0.03

    monkeypatch.setattr("auvnn.diagnosis.score_tests.null_tests.bonferroni", doubtful)
    found = diagnose(
        model, log, ["net_buoyancy", "constant_force"], advice=False, whiteness=False, stochastic=False
    )
    assert [s["verdict"] for s in found.steps] == ["named", "adequate"] and len(asked_for) == 2
    assert found.steps[1]["p_value"] == 0.03
    # The first is asked at 0.05.
    monkeypatch.setattr("auvnn.diagnosis.score_tests.null_tests.bonferroni", lambda p_values: 0.03)
    tried: list[int] = []
    choose = Chooser.choose
    monkeypatch.setattr(Chooser, "choose", lambda *a, **k: tried.append(1) or choose(*a, **k))
    diagnose(model, log, ["net_buoyancy", "constant_force"], advice=False, whiteness=False, stochastic=False)
    assert len(tried) == 1


def test_solvers_that_differ_are_no_force(model):
    """No noise at all, and steps of the plant that are a fifth of those with which a diagnosis begins."""
    log = make_log(model, runs=2, duration=15.0, noise=0.0, max_step=0.01)
    found = diagnose(model, log, ["net_buoyancy"], whiteness=False)
    assert (found.verdict, found.acts_in) == ("adequate", {})


def test_what_was_left_before_and_after():
    before = Unnamed(
        np.full(6, 9.0), np.full(6, 1e-9), np.array([80.0, 20.0, -5.0, 0, 0, 0]), {"X": 6.0, "Y": 2.0}
    )
    after = Unnamed(np.zeros(6), np.ones(6), np.array([10.0, -3.0, 0, 0, 0, 0]), {"X": 1.0})
    assert after.left_of(before) == pytest.approx(0.1) and before.left_of(after) == 1.0
    nothing = Unnamed(np.zeros(6), np.ones(6), np.zeros(6), {"X": 1e-12})
    assert before.shares == {"X": 0.75, "Y": 0.25}
    assert nothing.left_of(nothing) == 1.0 and sum(nothing.shares.values()) == pytest.approx(1.0)
