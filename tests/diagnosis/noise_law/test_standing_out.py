"""Names that are given in spite of what they leave."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.noise_law import withheld as module
from auvnn.diagnosis.noise_law.hypothesis import brings_most, explains_an_axis, stands_out
from auvnn.diagnosis.noise_law.withheld import explain_an_axis, leave_a_disturbance, withheld
from auvnn.diagnosis.residuals.forces import actuators_of
from auvnn.diagnosis.stages.state import State
from auvnn.metrics.force_law import ForceLaw
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


def hypothesis(name: str, evidence: float) -> Any:
    return SimpleNamespace(name=name, evidence=evidence - 1000.0)


@pytest.mark.parametrize(
    ("gain", "others", "expected"),
    [
        (401.0, {"waves": 100.0}, True),
        (399.0, {"waves": 100.0}, False),
        # What is known to be confused with it is no rival: the one may stand for the other.
        (401.0, {"waves": 100.0, "body_lift": 390.0}, True),
        (401.0, {"body_lift": 390.0, "tether": 101.0}, False),
        # Alone, or with others that explain nothing, it must still gain something.
        (101.0, {}, True),
        (99.0, {"waves": -5.0}, False),
    ],
)
def test_a_name_stands_out_that_gains_four_times_what_others_do(gain, others, expected):
    first = hypothesis("munk_moment", gain)
    found = [first, *(hypothesis(n, g) for n, g in others.items())]
    assert stands_out(first, found, hypothesis("", 0.0)) is expected


def beside(*rms: float) -> Any:
    law = ForceLaw(np.array(rms), np.full(6, 2.0), 0.5, 5.0) if rms else None
    return SimpleNamespace(estimate=SimpleNamespace(law=law))


def test_next_to_nothing_is_left_where_a_tenth_of_the_square_is():
    before = beside(4.0, 0.0, 2.0, 0.0, 1.0, 0.0)
    assert explains_an_axis(beside(4.0, 0.0, 2.0, 0.0, 0.31, 0.0), before)
    assert not explains_an_axis(beside(4.0, 0.0, 2.0, 0.0, 0.33, 0.0), before)
    # A degree of freedom that had none is not explained; all of it is where nothing is left.
    assert not explains_an_axis(before, before) and explains_an_axis(beside(), before)
    assert not explains_an_axis(before, beside())


@pytest.mark.parametrize(
    ("rms", "expected"),
    [
        # Of X, which the names before it took from 4 to 3 (16 to 9), it takes 9 to 1: more than they, and most of it.
        ((1.0, 0.0, 1.0, 0.0, 1.0, 0.0), True),
        # More than they, but less than half of what they left; or all that they left, and less than they took of Z.
        ((2.2, 0.0, 1.0, 0.0, 1.0, 0.0), False),
        ((3.0, 0.0, 0.0, 0.0, 1.0, 0.0), False),
        # What they did nothing about: half of it is asked for.
        ((3.0, 0.0, 1.0, 0.0, 0.7, 0.0), True),
        ((3.0, 0.0, 1.0, 0.0, 0.72, 0.0), False),
    ],
)
def test_a_further_name_may_take_most_of_the_force_of_an_axis_where_those_before_it_took_less(rms, expected):
    null, before = beside(4.0, 0.0, 4.0, 0.0, 1.0, 0.0), beside(3.0, 0.0, 1.0, 0.0, 1.0, 0.0)
    assert brings_most(beside(*rms), before, null) is expected
    # Without a force nothing can be taken of one; nor can be said how much of one that was not there before.
    assert not brings_most(beside(), beside(), null)
    assert not brings_most(beside(), beside(1.0, 1.0, 0.0, 0.0, 0.0, 0.0), null)


@pytest.mark.parametrize(
    ("refutes", "ahead", "explains", "together", "chance", "expected"),
    [
        (True, False, False, False, True, True),
        (True, True, False, False, True, False),
        (True, True, False, False, False, False),
        (True, False, True, False, True, False),
        # What is measured predicts what is left: a degree of freedom that was explained is no answer to that.
        (True, False, True, False, False, True),
        # Nor is one that all names together explain.
        (True, False, False, True, False, True),
        (True, False, False, True, True, False),
        (False, False, False, False, False, False),
    ],
)
def test_what_is_left_withholds_names_that_do_not_stand_out(
    monkeypatch, refutes, ahead, explains, together, chance, expected
):
    monkeypatch.setattr(module, "refuted", lambda *_, **__: refutes)
    monkeypatch.setattr(module, "share_left", lambda _: 1.0)
    monkeypatch.setattr(module, "explain_an_axis", lambda _: together)
    monkeypatch.setattr(module, "leave_a_disturbance", lambda *_: False)
    result: Any = SimpleNamespace(compared=None, stands_out=ahead, explains=explains, worsens=False)
    nothing: Any = None
    assert withheld(nothing, nothing, result, chance=chance) is expected
    # What was too large for a disturbance and is one now speaks for names as an explained degree of freedom does.
    monkeypatch.setattr(module, "explain_an_axis", lambda _: False)
    monkeypatch.setattr(module, "leave_a_disturbance", lambda *_: together)
    assert withheld(nothing, nothing, result, chance=chance) is expected
    # Names with which the model predicts worse are given where the first explains so much more than all others.
    result.worsens = True
    assert withheld(nothing, nothing, result, chance=chance) is not ahead


@pytest.mark.parametrize(
    ("names", "left", "expected"),
    [
        # 0.49 of 1.0 N m is 0.24 of its mean square; of the large force nothing was explained.
        (2, (4.0, 0.0, 0.0, 0.0, 0.49, 0.0), True),
        (2, (4.0, 0.0, 0.0, 0.0, 0.51, 0.0), False),
        # One name has to leave next to nothing, see `explains_an_axis`.
        (1, (4.0, 0.0, 0.0, 0.0, 0.49, 0.0), False),
        (2, None, True),
    ],
)
def test_several_names_may_explain_a_degree_of_freedom_together(names, left, expected):
    first = beside(4.0, 0.0, 0.0, 0.0, 1.0, 0.0).estimate.law
    law = None if left is None else beside(*left).estimate.law
    result: Any = SimpleNamespace(compared=law, first_law=first, steps=[{"effects": ["payload"]}] * names)
    assert explain_an_axis(result) is expected
    result.first_law = None
    assert not explain_an_axis(result)


@pytest.mark.parametrize(
    ("first", "left", "expected"),
    [
        # Shares of the largest moment of the actuators: half of it is too large for a disturbance.
        (1.2, 0.48, True),
        # More than a quarter of the mean square is left; still too large; and never too large.
        (0.9, 0.48, False),
        (1.2, 0.52, False),
        (0.48, 0.1, False),
    ],
)
def test_names_may_leave_a_disturbance_of_what_was_too_large_for_one(first, left, expected):
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    drive = actuators_of(model, windows)
    asked: Any = SimpleNamespace(layout=SimpleNamespace(model=model))
    state: Any = SimpleNamespace(windows=windows)

    def law(share: float) -> ForceLaw:
        # In heave a force is left that no name has to do with, and that is too large.
        moment, force = share * drive[3:].max(), 3.0 * drive[:3].max()
        return ForceLaw(np.array([0.0, 0.0, force, 0.0, moment, 0.0]), np.full(6, 2.0), 0.5, 5.0)

    result: Any = SimpleNamespace(
        estimate=SimpleNamespace(law=law(left)), compared=law(left), first_law=law(first),
        stands_out=False, explains=False, worsens=False, steps=[{"effects": ["cg_offset"]}],
    )  # fmt: skip
    assert leave_a_disturbance(asked, state, result) is expected
    assert withheld(asked, state, result, chance=True) is not expected
    assert withheld(asked, state, result, chance=False)
    # What counts as left is acceleration, and beside the actuators the force with the names.
    result.compared = law(0.9 * first)
    assert not leave_a_disturbance(asked, state, result)
    result.compared, result.estimate.law = law(left), law(0.52)
    assert not leave_a_disturbance(asked, state, result)
    result.compared = law(0.52)
    result.estimate.law = law(left)
    assert leave_a_disturbance(asked, state, result) is expected
    # Where nothing was left before any name, names have taken nothing away.
    result.first_law = None
    assert not leave_a_disturbance(asked, state, result)


@pytest.mark.parametrize(
    ("worse", "ahead", "told"), [(True, False, True), (True, True, False), (False, False, False)]
)
def test_names_with_which_the_model_predicts_worse_are_nearest_and_a_note_says_why(
    monkeypatch, worse, ahead, told
):
    monkeypatch.setattr(module, "refuted", lambda *_, **__: False)
    monkeypatch.setattr(module, "negligible", lambda *_: False)
    monkeypatch.setattr(module, "sized_by_law", lambda *_: {})
    nothing: Any = None
    first: Any = "without any name"
    named: Any = SimpleNamespace(
        steps=[{"verdict": "ambiguous", "effects": ["tether", "payload"], "p_value": 0.0}], groups=[], tried=[],
        last=SimpleNamespace(effects=("tether",)), estimate=SimpleNamespace(law=None), first_law=None,
        compared=None, stands_out=ahead, explains=False, worsens=worse,
    )  # fmt: skip
    state = State(nothing, first, first)
    ended = module.state_with(SimpleNamespace(layout=None), state, state, named, nothing, chance=True)  # type: ignore[arg-type]
    if told:
        assert ended.chosen == () and ended.nearest == ("tether", "payload") and ended.current == first
        assert [s["verdict"] for s in ended.steps] == ["unknown"]
        assert len(ended.notes) == 1 and "tether, payload" in ended.notes[0] and "worse" in ended.notes[0]
    else:
        assert ended.chosen == ("tether",) and not ended.notes
