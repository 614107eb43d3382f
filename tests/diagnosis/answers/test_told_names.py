"""Names in the order of what they cost the predictions, and without those that are not known to improve them."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers.effect_costs import Cost
from auvnn.diagnosis.answers.told_names import costliest_first, known_to_pay
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.cross_validation.errors import Gain
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

answering = importlib.import_module("auvnn.diagnosis.answers.answering")
diagnosing = importlib.import_module("auvnn.diagnosis.diagnose")
NAMES = ["net_buoyancy", "constant_force"]


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def found_in(model, truth, **options):
    log = make_log(model.with_effects(truth), runs=4, duration=12.0, noise=1.0, seed=4)
    return diagnose(model, log, NAMES, advice=False, whiteness=False, **options)


USUAL = Tolerance.of(None)


def step(verdict, *effects):
    return {"verdict": verdict, "effects": list(effects), "p_value": 0.0}


def costing(**gains):
    """Return costs with falls of the error {name: (value, std)}."""
    return {
        n: Cost(None if g is None else Gain(*g, {}, 0.3, 0.2), np.zeros(6), np.zeros(6), True)
        for n, g in gains.items()
    }


def names_of(steps):
    return [s["effects"][0] if s["effects"] else s["verdict"] for s in steps]


def test_a_name_that_surely_costs_more_goes_ahead():
    steps = [step("named", "a"), step("ambiguous", "b", "c"), step("adequate")]
    costs = costing(a=(0.0023, 0.0030), b=(0.0407, 0.0079))
    found = costliest_first(steps, costs, USUAL)
    assert names_of(found) == ["b", "a", "adequate"] and found[0]["effects"] == ["b", "c"]
    # Two standard errors of the difference decide.
    near = costing(a=(0.10, 0.03), b=(0.19, 0.04))
    assert names_of(costliest_first(steps, near, USUAL)) == ["a", "b", "adequate"]
    far = costing(a=(0.10, 0.03), b=(0.21, 0.04))
    assert names_of(costliest_first(steps, far, USUAL)) == ["b", "a", "adequate"]


def test_every_name_goes_ahead_of_those_that_surely_cost_less_and_of_no_other():
    steps = [step("named", n) for n in "abc"]
    rising = costing(a=(0.1, 0.01), b=(0.2, 0.01), c=(0.3, 0.01))
    assert names_of(costliest_first(steps, rising, USUAL)) == ["c", "b", "a"]
    # c surely costs more than a, whatever stands between them.
    among = costing(a=(0.1, 0.01), b=(0.2, 0.2), c=(0.3, 0.01))
    assert names_of(costliest_first(steps, among, USUAL)) == ["c", "a", "b"]
    # In the model's own world nothing but the evidence counts.
    assert costliest_first(steps, among, Tolerance.of(0.0)) == steps


def test_steps_without_a_name_or_with_one_whose_cost_is_unknown_stay_where_they_are():
    steps = [
        step("named", "a"),
        step("named", "b"),
        step("withdrawn", "a"),
        step("named", "c"),
        step("unknown"),
    ]
    found = costliest_first(steps, costing(b=(0.1, 0.01), c=(0.3, 0.01)), USUAL)
    assert names_of(found) == ["a", "c", "a", "b", "unknown"]
    lost = costing(b=(0.1, 0.01), c=(np.inf, np.inf))
    assert costliest_first(steps, lost, USUAL) == steps
    assert costliest_first(steps, costing(b=None, c=(0.3, 0.01)), USUAL) == steps
    assert costliest_first(steps, {}, USUAL) == steps


@pytest.mark.parametrize("turned", [False, True])
def test_what_costs_most_is_said_first_whatever_was_found_first(model, monkeypatch, turned):
    def found_in_another_order(asked, state):
        named = [s for s in state.steps if s["verdict"] == "named"]
        assert len(named) == 2
        rest = [s for s in state.steps if s["verdict"] != "named"]
        return state.but(steps=(*(named[::-1] if turned else named), *rest))

    monkeypatch.setattr(diagnosing, "settled", found_in_another_order)
    found = found_in(model, {"net_buoyancy": {"force": 8.0}, "constant_force": {"X": 5.0}})
    costs = {n: found.matters[n]["gain"]["value"] for n in found.missing}
    assert list(found.missing) == sorted(costs, key=lambda n: -costs[n]) and found.verdict == "named"
    assert [s["effects"] for s in found.steps if s["effects"]] == [[n] for n in found.missing]
    assert [c["effect"] for c in found.candidates[:2]] == list(found.missing)
    assert found.missing[0] in found.story[0] and found.missing[1] in found.story[1]


def falling(value, std, **by_dof):
    """Return a cost by its fall in total, (value, std), and by velocity; the error after is 0.2 in each."""
    gain = Gain(value, std, by_dof, 0.3, 0.2, dict.fromkeys(by_dof, 0.2))
    return Cost(gain, np.zeros(6), np.zeros(6), True)


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (falling(0.02, 0.01), True),
        (falling(0.002, 0.003), False),
        (falling(-0.1, 0.01), False),
        # Surely, and by more than the tolerance, in one velocity.
        (falling(0.002, 0.003, u=(0.06, 0.02), v=(-0.05, 0.1)), True),
        (falling(0.002, 0.003, u=(0.06, 0.05)), False),
        (falling(0.002, 0.003, u=(0.0001, 0.00001)), False),
        (falling(np.inf, np.inf), True),
        (Cost(None, np.zeros(6), np.zeros(6), True), True),
    ],
)
def test_a_further_name_is_told_where_it_is_known_to_improve_predictions(second, told):
    steps = [step("named", "cg_offset"), step("ambiguous", "tether", "payload"), step("adequate")]
    costs = {"cg_offset": falling(0.001, 0.01), "tether": second}
    kept, gone = known_to_pay(steps, costs, USUAL)
    assert kept == (steps if told else [steps[0], steps[2]])
    assert gone == ([] if told else ["tether", "payload"])
    # A single name stays, whatever it costs, and with a tolerance of zero each does.
    assert known_to_pay(steps, costs, Tolerance.of(0.0)) == (steps, [])
    alone = [steps[1], steps[2]]
    assert known_to_pay(alone, costs, USUAL) == (alone, [])


def test_a_name_beside_which_the_first_one_was_withdrawn_is_the_first():
    steps = [step("named", "a"), step("named", "tether"), step("withdrawn", "a"), step("adequate")]
    assert known_to_pay(steps, {"tether": falling(0.001, 0.01)}, USUAL) == (steps, [])


def test_names_of_one_step_are_judged_each_by_itself():
    steps = [step("named", "cg_offset"), step("named", "tether", "payload"), step("adequate")]
    costs = {n: falling(0.1, 0.01) for n in ("cg_offset", "payload")} | {"tether": falling(0.001, 0.01)}
    kept, gone = known_to_pay(steps, costs, USUAL)
    assert [s["effects"] for s in kept] == [["cg_offset"], ["payload"], []] and gone == ["tether"]
    # In the order they count with the larger of the two.
    late = [step("named", "fin_lag"), steps[1]]
    first = costliest_first(late, {**costs, "fin_lag": falling(0.02, 0.01)}, USUAL)[0]
    assert first["effects"] == ["tether", "payload"]


def test_of_several_that_do_not_pay_the_one_that_brings_most_stays():
    """Each may stand in for the other: without both the error might be larger by far."""
    steps = [step("named", n) for n in ("cg_offset", "tether", "payload", "fin_lag")]
    costs = {"cg_offset": falling(0.1, 0.01)} | {
        n: falling(v, 0.01) for n, v in (("tether", 0.001), ("payload", 0.003), ("fin_lag", -0.002))
    }
    kept, gone = known_to_pay(steps, costs, USUAL)
    assert names_of(kept) == ["cg_offset", "payload"] and gone == ["tether", "fin_lag"]
    # But none that surely makes predictions worse.
    worse = {"cg_offset": costs["cg_offset"]} | {
        n: falling(v, 0.01) for n, v in (("tether", -0.02), ("payload", -0.03), ("fin_lag", -0.05))
    }
    assert names_of(known_to_pay(steps, worse, USUAL)[0]) == ["cg_offset"]


def test_what_a_name_needs_beside_it_stays():
    steps = [step("named", "drag_only_current"), step("named", "ocean_current"), step("named", "tether")]
    costs = {
        "drag_only_current": falling(0.1, 0.01),
        "ocean_current": falling(0.0, 0.1),
        "tether": falling(-0.1, 0.1),
    }
    assert known_to_pay(steps, costs, USUAL) == (steps[:2], ["tether"])


def test_what_a_name_could_act_with_goes_where_something_else_is_there_for_that():
    steps = [step("named", n) for n in ("ocean_current", "drag_only_current", "current_shear")]
    costs = {n: falling(0.1, 0.01) for n in ("ocean_current", "drag_only_current")}
    costs["current_shear"] = falling(0.001, 0.01)
    assert known_to_pay(steps, costs, USUAL) == (steps[:2], ["current_shear"])


@pytest.mark.parametrize(
    ("told", "group"), [(["b", "c"], ["b", "c"]), (["e", "f"], ["e", "f"]), (None, None)]
)
def test_the_next_experiment_is_about_the_first_group_that_is_told(model, monkeypatch, told, group):
    """Of two groups one may be told first that was found later, and one that does not pay is not told at all."""
    explained = SimpleNamespace
    groups = tuple(tuple(explained(effects=("a", n)) for n in names) for names in (("b", "c"), ("e", "f")))
    steps = [step("named", "a"), *([step("ambiguous", *told)] if told else [])]
    monkeypatch.setattr(
        answering,
        "advise",
        lambda _, __, found, *___: explained(to_dict=lambda: [e.effects[-1] for e in found]),
    )
    asked = explained(model=model, advice=True, layout=None, say=print)
    assert answering._next(asked, explained(groups=groups), steps, []) == group


def test_the_answer_says_which_name_was_left_out(model, monkeypatch):
    """Of two forces one is said to cost nothing: it is no name then, and the warnings have it."""
    told = importlib.import_module("auvnn.diagnosis.answers.told_names")
    monkeypatch.setattr(told, "_pays", lambda fall, tolerance: False)
    found = found_in(model, {"net_buoyancy": {"force": 8.0}, "constant_force": {"X": 5.0}})
    (name,) = found.missing
    (other,) = {*NAMES} - {name}
    assert [s["effects"] for s in found.steps if s["effects"]] == [[name]] and {*found.matters} == {name}
    assert any(w.startswith(f"not named: {other}") for w in found.warnings)
    assert found.unsure == found.to_dict()["unsure"] == [other]
    assert any(
        f"With that, and with {other} (see the warnings), the model is adequate" in x for x in found.story
    )
    assert not any(line.startswith(f"Missing: {other}") for line in found.story)
