"""Where nothing is missing but the stated coefficients are off, the answer says what refitting them brings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers import refitted_coefficients
from auvnn.diagnosis.answers.refitted_coefficients import refitted_words
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


def test_a_log_that_is_too_short_to_leave_a_part_out_has_an_answer_without_it():
    short = make_log(GreyBox(vehicle(1.4)), runs=1, duration=4.0, noise=1.0, seed=6)
    found = diagnose(GreyBox(vehicle()), short, effects=["net_buoyancy"], advice=False)
    assert found.refitted is None or np.isfinite(found.refitted["after"])


def test_many_coefficients_are_told_in_part():
    one = {"group": "added_mass", "coefficient": "X", "stated": 1.0, "fitted": 1.2, "deviations": 2.0}
    many = {
        "before": 0.5,
        "after": 0.1,
        "horizon": 5.0,
        "gain": {"value": 0.4, "std": 0.1},
        "coefficients": [one] * 9,
    }
    (words,) = refitted_words(many)
    assert words.count("added_mass.X times 1.2 (+2.0)") == 6 and "and 3 more" in words
    assert "0.5 over 5 s of free running, refitted by 0.1" in words
