"""What each kind of page says about its answer, in words."""

import numpy as np
import pytest

from tests.report.html_reading import PageText
from tests.report.report_fakes import comparison, diagnosis, drawer, improvement, make, quality, training


@pytest.fixture(scope="module", autouse=True)
def layout():
    """Leave the parts of figures where they are: these tests ask about words."""


def test_comparison_says_how_far_off_and_where(unseen):
    text = PageText(drawer("comparison").page(comparison(60))).text
    assert "Running free for 5 s, the model's error is 26 % of the spread" in text
    assert "would give 95 %" in text and "The model predicts." in text
    assert "sway (Y): heading -1.6 to 0 rad (42 % of the error)" in text
    assert "diverged in 1 window" in text
    assert "stands out most in roll (K): 9.00 N m rms, 30 times the noise floor" in text
    assert "bandwidth 1.70 Hz" in text


@pytest.mark.parametrize(("held", "words"), [(0.1, "worse than none"), (0.26, "no better than none")])
def test_comparison_does_not_flatter(unseen, held, words):
    answer = comparison(60)
    answer.rollout["5"]["persistence"] = held
    assert words in PageText(drawer("comparison").page(answer)).text


def test_the_map_names_its_largest_cell(unseen):
    answer = comparison(60)
    answer.regimes["speed"]["rms"][3, 1] = 300.0
    text = PageText(drawer("comparison").page(answer)).text
    assert "The largest: K at speed 0.20 to 0.40 m/s, 1000 times the noise floor." in text


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (
            "named",
            ["The model lacks ocean_current.", "v_north 0.2031 ± 0.0042", "hard to tell from constant_force"],
        ),
        ("ambiguous", ["cannot tell which: ocean_current or constant_force"]),
        ("unknown", ["nothing in the catalogue explains", "What remains depends most on u"]),
        (
            "adequate",
            ["Nothing is missing that this log could show", "10 effects of the catalogue were tried"],
        ),
    ],
)
def test_diagnosis_says_its_verdict(unseen, verdict, words):
    page = PageText(drawer("diagnosis").page(diagnosis(verdict)))
    for part in words:
        assert part in page.text
    assert "not judged: needs altitude" in page.text


def test_a_value_other_than_stated_is_no_effect_that_lacks(unseen):
    answer = diagnosis("named")
    answer.stated = {"ocean_current": {"v_north": 0.1, "v_east": 0.0, "v_down": 0.0}}
    answer.next_experiment = None
    text = PageText(drawer("diagnosis").page(answer)).text
    assert "What the model has at other values: ocean_current" in text
    assert "The model has ocean_current at other values than the log." in text and "lacks" not in text
    assert "auvnn add with effect=ocean_current and refit=true fits it" in text
    answer.missing = [*answer.missing, "net_buoyancy"]
    text = PageText(drawer("diagnosis").page(answer)).text
    assert "The model lacks net_buoyancy and has ocean_current at other values than the log." in text


def test_inputs_that_the_log_cannot_tell_apart_are_said_together(unseen):
    depends = {"Z": {"u": 0.295, "fin_3": 0.293, "fin_4": 0.292}}
    answer = diagnosis("unknown", depends_on=depends, inseparable={"Z": [["u", "fin_3", "fin_4"]]})
    answer.json = (*answer.json, "inseparable")
    text = PageText(drawer("diagnosis").page(answer)).text
    assert "What remains depends most on u" in text
    assert "This log cannot tell it from fin_3 or fin_4." in text


@pytest.mark.parametrize(("accepted", "words"), [(True, ": accepted."), (False, ": not accepted.")])
def test_improvement_says_whether_it_was_accepted(unseen, accepted, words):
    page = PageText(drawer("improvement").page(improvement(60, accepted=accepted)))
    assert words in page.text
    assert (
        "26 % of the spread of the motion, by 21 % with its coefficients fitted again, and by 5 % with"
        in page.text
    )
    assert "95 % of what could be gained" in page.text


@pytest.mark.parametrize(
    ("idle", "words"),
    [
        (
            ["fin_gain"],
            "but fin_gain adds nothing to what the others bring: leave it out. Not accepted as it is.",
        ),
        (
            ["fin_gain", "body_lift"],
            "fin_gain, body_lift do not add to what the others bring: leave one",
        ),
        ([], "no more than chance could: not accepted."),
    ],
)
def test_an_effect_that_adds_nothing_is_said_to_be_what_is_not_accepted(unseen, idle, words):
    """The error falls by far more than chance could; only one of the effects has no part in that."""
    names = ["ocean_current", "fin_gain", "body_lift"]
    own = {
        n: {"gain": {"value": 0.1 * (n not in idle), "std": 0.01}, "accepted": n not in idle} for n in names
    }
    fall = {"value": 0.1, "std": 0.01}
    answer = improvement(60, accepted=False, effects=names, gain=fall, by_effect=own)
    assert words in PageText(drawer("improvement").page(answer)).text


def test_a_name_that_is_not_known_to_pay_is_told_apart(unseen):
    told = PageText(drawer("diagnosis").page(diagnosis("named", unsure=["tether", "payload"]))).text
    assert "not known to improve predictions: tether and payload." in told
    assert "not known to improve" not in PageText(drawer("diagnosis").page(diagnosis("named"))).text


def test_a_model_that_a_regression_still_beats_is_told_after_the_verdict(unseen):
    line = {
        "total": 0.04,
        "persistence": {"total": 0.9},
        "model": {"total": 0.052},
        "horizon": "5",
        "loses": {},
    }
    told = PageText(drawer("improvement").page(improvement(60, baseline=line))).text
    assert (
        ": accepted. A plain regression (0.04) still predicts better than this model (0.052): more is" in told
    )
    line["model"] = {"total": 0.03}
    assert "still predicts" not in PageText(drawer("improvement").page(improvement(60, baseline=line))).text


def test_quality_says_what_is_wrong_and_how_to_mend_it(unseen):
    page = PageText(drawer("quality").page(quality(60)))
    assert "p has the opposite sign of the attitude's derivative (scale: -1 in the mapping)" in page.text
    assert "the sign of roll (p) and pitch (q) is reversed" in page.text
    assert "Too little moves in roll (p)" in page.text
    error = {"level": "error", "where": "time", "what": "median step 20 s", "cure": "time: {unit: ms}"}
    page = PageText(drawer("quality").page(quality(60, findings=[error])))
    assert (
        "Nothing should be fitted to this log as it is: time: median step 20 s (time: {unit: ms})."
        in page.text
    )


def test_training_says_where_it_was_best(unseen):
    text = PageText(drawer("training").page(training())).text
    assert "from 0.870 to 0.100" in text and "is step 127" in text
    assert "396" in text and "396.0" not in text


def test_training_takes_damping_in_every_form():
    from auvnn.report.pages.training import curves

    nu = np.linspace(-1, 1, 5)
    listed = curves([{"velocity": nu, "force": 2 * nu}] * 6)
    named = curves({c: {"nu": nu, "learned": 2 * nu} for c in "uvwpqr"})
    by_axis = curves({a: {"nu": nu, "d": 2 * nu} for a in "XYZKMN"})
    tabled = curves(
        {
            "nu": np.tile(nu, (6, 1)),
            "learned": np.tile(2 * nu, (6, 1)),
            "covered": np.tile([-0.5, 0.5], (6, 1)),
        }
    )
    paired = curves([(nu, 2 * nu)] * 6)
    for found in (listed, named, by_axis, tabled, paired):
        assert len(found) == 6
        for curve in found:
            np.testing.assert_array_equal(curve["nu"], nu)
            np.testing.assert_array_equal(curve["learned"], 2 * nu)


def test_training_as_the_verb_answers_it(unseen):
    from auvnn.report.pages.training import curves

    nu = np.linspace(-1, 1, 5)
    found = curves([{"nu": nu, "learned": nu, "low": -0.5, "high": 0.25}] * 6)
    assert found[0]["covered"] == (-0.5, 0.25) and "low" not in found[0]
    answer = training(
        scheme={"scheme": "levenberg_marquardt", "max_iterations": 300},
        damping={"form": "mlp", "hidden": 5},
        history={
            "iteration": [1, 2, 3],
            "train": [3.0, 2.0, 1.0],
            "held_out": [3.0, 1.5, 2.0],
            "step": "iteration",
        },
        metrics={"held_out_r2_du_before": 0.1, "held_out_r2_du_after": 0.7, "iterations": 3},
        stopped="the held-out error rises",
    )
    text = PageText(drawer("training").page(answer)).text
    assert "The best of 3 iterations is iteration 2" in text
    assert "most is gained in surge (du): R² from 0.10 to 0.70" in text
    assert "levenberg_marquardt, max iterations 300" in text and "mlp, hidden 5" in text
    assert "It stopped because: the held-out error rises." in text


def test_demo_tells_the_whole_story_once(pages):
    page = PageText(pages["demo"])
    assert [a["href"] for a in page.named("a")] == ["#quality", "#comparison", "#diagnosis", "#improvement"]
    for line in ("error over 5 s before: 0.26", "missing: ocean_current"):
        assert line in page.text
    assert "What had been hidden: v_north 0.200 (found 0.2031" in page.text
    assert page.text.count("Before and after, on a held-out run.") == 1
    assert page.text.count("The candidates.") == 1


class Network:
    """A model as an answer carries it: no name of its own, and a very long description."""

    def __str__(self):
        return "GreyBox(" + "Linear(), " * 500


@pytest.mark.parametrize("kind", ["improvement", "training"])
def test_an_answer_that_carries_its_model_is_called_by_the_models_name(unseen, kind):
    answer = make(kind, 60)
    json_answer = {**answer.to_dict(), "model": "rov95"}
    answer.model, answer.to_dict = Network(), lambda: json_answer
    text = PageText(drawer(kind).page(answer)).text
    assert "GreyBox(" not in text and "rov95" in text
