"""Where nothing is missing but the stated coefficients are off, the answer says what refitting them brings."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers import refitted_coefficients
from auvnn.diagnosis.answers.moved_coefficients import moved_beyond
from auvnn.diagnosis.answers.refitted_coefficients import refitted_words
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.errors import InputError
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from auvnn.report.pages.diagnosis import DiagnosisPage
from auvnn.report.view import View
from tests.small_logs import make_log, small_vehicle

UNCERTAIN = {"added_mass": 0.1, "linear_damping": 0.4, "quadratic_damping": 0.4, "inertia": 0.05}


def vehicle(factor=1.0):
    plain = small_vehicle(UNCERTAIN)
    return replace(
        plain,
        linear_damping=factor * np.asarray(plain.linear_damping),
        quadratic_damping=factor * np.asarray(plain.quadratic_damping),
    )


@pytest.fixture(scope="module")
def log():
    return make_log(GreyBox(vehicle(1.4)), runs=3, duration=30.0, noise=1.0, seed=4)


@pytest.fixture(scope="module")
def found(log):
    return diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy", "cg_offset"], advice=False)


def test_what_the_coefficients_in_the_file_cost_is_told(found, log):
    assert found.verdict == "adequate" and not found.missing
    told = found.refitted
    # What the model of the file errs by is what it errs by in a comparison, and refitted it errs as the truth does.
    scale = scale_of(log)
    as_given, truth = (roll(GreyBox(vehicle(f)), log, "5", scale).total(scale) for f in (1.0, 1.4))
    assert told["before"] == pytest.approx(as_given, rel=1e-6)
    assert told["after"] == pytest.approx(truth, rel=0.15)
    assert told["gain"]["value"] == pytest.approx(told["before"] - told["after"])
    assert told["gain"]["value"] > 2.0 * told["gain"]["std"] > 0.0
    damping = [c for c in told["coefficients"] if c["group"].endswith("damping")]
    assert damping and all(c["fitted"] > 1.0 for c in damping)
    assert all(c["deviations"] == pytest.approx((c["fitted"] - 1.0) / 0.4) for c in damping)
    # What moved by less than one of its stated standard deviations is not told.
    every = moved_beyond(lay_out(GreyBox(vehicle()), ["net_buoyancy", "cg_offset"]), found.explanation, 0.0)
    assert told["coefficients"] == [c for c in every if abs(c["deviations"]) > 1.0] != every


def test_it_is_in_the_story_the_json_and_the_report(found):
    words = " ".join(found.story)
    assert found.story[0].startswith("Nothing is missing")
    assert "With the values of its file the model errs by" in found.story[1]
    assert f"refitted by {found.refitted['after']:.3g}" in words
    # One sentence tells of the coefficients.
    assert words.count("quadratic_damping.X") <= 1
    data = found.to_dict()
    assert data["refitted"]["after"] == found.refitted["after"]
    page = DiagnosisPage()
    view = View(data)
    assert "coefficients are off" in page.title(view)
    assert any("With the values of its file" in line for line in page.brief(view))
    assert page.brief(view)[0].startswith("With the stated coefficients refitted nothing is missing")


def test_where_the_coefficients_are_right_nothing_is_told():
    exact = make_log(GreyBox(vehicle()), runs=3, duration=30.0, noise=1.0, seed=5)
    found = diagnose(GreyBox(vehicle()), exact, effects=["net_buoyancy", "cg_offset"], advice=False)
    assert found.verdict == "adequate" and found.refitted is None
    assert refitted_words(found.refitted) == []
    assert "coefficients are off" not in DiagnosisPage().title(View(found.to_dict()))


@pytest.mark.parametrize("options", [{"tolerance": 0.0}, {"costs": False}])
def test_nothing_is_worked_out_where_costs_decide_nothing(log, options, monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(refitted_coefficients, "left_out_by", refuse)
    found = diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy"], advice=False, **options)
    assert found.refitted is None


def test_what_is_within_the_tolerance_is_not_told(log):
    found = diagnose(
        GreyBox(vehicle()),
        log,
        effects=["net_buoyancy"],
        advice=False,
        tolerance={"cost": 99.0, "force": 0.9},
    )
    assert found.verdict == "adequate" and found.refitted is None


@pytest.mark.parametrize("problem", [InputError("too short"), np.linalg.LinAlgError(), FloatingPointError()])
def test_an_answer_needs_nothing_of_it(log, monkeypatch, problem):
    """A log may be too short to leave a part of it out."""

    def refuse(*_):
        raise problem

    monkeypatch.setattr(refitted_coefficients, "left_out_found", refuse)
    found = diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy"], advice=False)
    assert found.verdict == "adequate" and found.refitted is None


def test_parts_that_cannot_be_fitted_tell_nothing(log, monkeypatch):
    usual = refitted_coefficients.left_out_found
    monkeypatch.setattr(
        refitted_coefficients,
        "left_out_found",
        lambda *a: replace(usual(*a), reason="the fit without run 1 failed"),
    )
    assert diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy"], advice=False).refitted is None


def test_many_coefficients_are_told_in_part():
    one = {"group": "added_mass", "coefficient": "X", "stated": 1.0, "fitted": 1.2, "deviations": 2.0}
    many = {
        "before": 0.5,
        "after": 0.1,
        "horizon": 5.0,
        "gain": {"value": 0.4, "std": 0.1},
        "coefficients": [one] * 9,
        "command": "",
    }
    (words,) = refitted_words(many)
    assert words.startswith("That holds with the stated coefficients refitted")
    assert words.count("added_mass.X times 1.2 (+2.0)") == 6 and "and 3 more" in words
    assert words.endswith("0.5 over 5 s of free running, refitted by 0.1 on what was left out.")


def told(value):
    return {
        "before": 0.5,
        "after": 0.5 - value,
        "horizon": 5.0,
        "gain": {"value": value, "std": 0.01},
        "coefficients": [],
        "command": "",
    }


@pytest.mark.parametrize(
    ("gains", "begin"),
    [
        ([0.2], "Above all"),
        ([0.4], "Beside that"),
        ([0.2, 0.4], "Beside that"),
        ([None], "Beside that"),
        ([], "Beside that"),
        ([0.2, None], "Beside that"),
    ],
)
def test_beside_names_it_says_which_of_them_predictions_suffer_from_most(gains, begin):
    matters = {
        str(k): {"gain": None if g is None else {"value": g, "std": 0.01}} for k, g in enumerate(gains)
    }
    (words,) = refitted_words(told(0.3), matters)
    assert words.startswith(f"{begin} the stated coefficients are off")
    assert "the model, with what is named, errs by 0.5" in words


@pytest.fixture(scope="module")
def heavier():
    """A vehicle whose drag is off within what is stated of it, and that a force pushes down besides."""
    truth = GreyBox(vehicle(1.4)).with_effects({"net_buoyancy": {"force": -6.0}})
    log = make_log(truth, runs=3, duration=30.0, noise=1.0, seed=4)
    return diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy", "cg_offset"], advice=False), log


def test_beside_a_name_only_the_coefficients_are_as_stated(heavier):
    found, log = heavier
    assert found.missing == ["net_buoyancy"]
    named = GreyBox(vehicle()).with_effects({"net_buoyancy": {"force": -6.0}})
    scale = scale_of(log)
    assert found.refitted["before"] == pytest.approx(roll(named, log, "5", scale).total(scale), rel=0.1)
    # The name is not what the coefficients bring.
    bare = roll(GreyBox(vehicle()), log, "5", scale).total(scale)
    assert found.refitted["before"] < 0.95 * bare
    assert found.refitted["after"] < 0.5 * found.refitted["before"]
    assert {c["group"] for c in found.refitted["coefficients"]} <= {
        "added_mass",
        "linear_damping",
        "quadratic_damping",
        "inertia",
    }


def test_what_predictions_suffer_from_most_is_said_first(heavier):
    found, _ = heavier
    gain = found.matters["net_buoyancy"]["gain"]["value"]
    first = "Above all" if found.refitted["gain"]["value"] > gain else "Missing: net_buoyancy"
    assert found.story[0].startswith(first)
    more = replace(found, refitted={**found.refitted, "gain": {"value": 0.5 * gain, "std": 0.0}})
    assert more.story[0].startswith("Missing: net_buoyancy")
    assert any(line.startswith("Beside that the stated") for line in more.story)


def test_where_something_without_a_name_is_left_coefficients_take_up_what_they_can_of_it(heavier):
    """So nothing is said of them."""
    _, log = heavier
    found = diagnose(GreyBox(vehicle()), log, effects=["gyro_bias"], advice=False)
    assert found.verdict in ("unknown", "partial") and found.refitted is None
    assert not any("stated coefficients are off" in line for line in found.story)


def test_nor_is_it_where_a_name_leaves_something_without_one():
    """A force that no candidate explains is left beside the name."""
    truth = GreyBox(vehicle(1.4)).with_effects(
        {"net_buoyancy": {"force": -6.0}, "thruster_gain": {"thruster_1": 0.3}, "gyro_bias": {"p": 0.05}}
    )
    log = make_log(truth, runs=3, duration=30.0, noise=1.0, seed=4)
    found = diagnose(GreyBox(vehicle()), log, effects=["net_buoyancy"], advice=False)
    assert found.steps[-1]["verdict"] == "unknown" and found.refitted is None


def test_names_may_follow_the_stated_coefficients(heavier, monkeypatch):
    """What the coefficients bring is no more than what is lost with names that are fitted beside stated coefficients."""
    found, log = heavier
    named = GreyBox(vehicle())
    best = min(
        roll(named.with_effects({"net_buoyancy": {"force": f}}), log, "5", scale_of(log)).total(scale_of(log))
        for f in np.linspace(-9.0, -3.0, 25)
    )
    fitted = next(c for c in found.candidates if c["effect"] == "net_buoyancy")["parameters"]["force"][
        "value"
    ]
    stays = roll(named.with_effects({"net_buoyancy": {"force": fitted}}), log, "5", scale_of(log))
    assert best * 0.999 <= found.refitted["before"] <= stays.total(scale_of(log)) * 1.001


def test_a_model_with_learned_damping_is_told_nothing_of_its_coefficients(log, monkeypatch):
    from auvnn.diagnosis.answers.refitted_coefficients import refitted_coefficients as worked_out

    asked: Any = SimpleNamespace(
        layout=SimpleNamespace(nuisance=("linear_damping", "learned_drag")), costs=True,
        tolerance=SimpleNamespace(strict=False),
    )  # fmt: skip
    state: Any = SimpleNamespace(current=None, steps=[{"verdict": "adequate"}])
    assert worked_out(asked, state) is None


def test_a_name_that_looks_like_the_coefficients_follows_them():
    """Thrust and drag go together: beside the drag of the file another gain predicts better than the fitted one."""
    gains = {f"thruster_{i + 1}": 0.8 for i in range(8)}
    truth = GreyBox(vehicle(1.4)).with_effects({"thruster_gain": gains})
    log, model = make_log(truth, runs=3, duration=30.0, noise=1.0, seed=4), GreyBox(vehicle())
    found = diagnose(model, log, effects=["thruster_gain"], advice=False)
    assert found.missing == ["thruster_gain"]
    asked: Any = SimpleNamespace(model=model, layout=lay_out(model, ["thruster_gain"]))
    models = refitted_coefficients._as_stated(asked, found.explanation)
    for made in models:
        # The coefficients are those of the file; the names are not gone.
        np.testing.assert_allclose(made.prepare().body.quadratic, model.prepare().body.quadratic)
        assert made.effect_names == ["thruster_gain"]
        assert all(0.3 < g < 0.95 for g in made.effect("thruster_gain").values().values())
    follows, stays = (roll(m, log, "5", scale_of(log)).total(scale_of(log)) for m in models)
    assert follows < 0.9 * stays
    assert found.refitted is None or found.refitted["before"] == pytest.approx(follows, rel=1e-6)
