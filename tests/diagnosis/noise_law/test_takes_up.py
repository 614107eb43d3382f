"""A further name that only takes up what earlier ones get wrong is no name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import answer, under_law
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.search import ForceSearch


@pytest.mark.parametrize(
    ("further", "gained", "predicted", "exerts", "expected"),
    [
        ("constant_force", 40.0, 0.3, 1.5, True),
        # What the form of an asymmetry gets wrong looks like a constant force, whatever inputs predict.
        ("constant_force", 40.0, 0.05, 1.5, True),
        ("constant_force", 40.0, None, 1.5, True),
        # But it does not exert many times what the asymmetry does.
        ("constant_force", 40.0, 0.3, 2.5, False),
        ("constant_force", 40.0, None, 2.5, False),
        # Known to be confused with one before it, and no more than that.
        ("thruster_gain", 40.0, 0.3, 0.5, True),
        ("thruster_gain", 40.0, 0.3, 2.5, True),
        ("thruster_gain", 40.0, 0.05, 0.5, False),
        ("thruster_gain", 40.0, None, 0.5, False),
        # Half as much as the two names before it, each, is more than what they get wrong, if it also exerts more.
        ("constant_force", 49.0, 0.3, 1.5, True),
        ("constant_force", 51.0, 0.3, 1.5, False),
        ("constant_force", 400.0, None, 0.5, True),
        ("constant_force", 400.0, None, 1.5, False),
        # Not known to be confused with what was named before it.
        ("gyro_bias", 40.0, 0.3, 0.5, False),
    ],
)
def test_a_further_name_that_takes_up_what_an_earlier_one_gets_wrong_is_no_name(
    further, gained, predicted, exerts, expected, monkeypatch
):
    told = None if predicted is None else InputPrediction("X", "u", 0.5, predicted)
    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.in_closed_loop, asked.asked = True, SimpleNamespace(stated={"waves": None})
    monkeypatch.setattr(under_law, "predicted_by_inputs", lambda *_, **__: told)
    compared = []

    def exerts_less(*given: Any) -> bool:
        compared.append(given[3:5])
        return exerts < given[5]

    monkeypatch.setattr(name_after_name, "exerts_less", exerts_less)
    monkeypatch.setattr(asked, "say", lambda _: None, raising=False)
    monkeypatch.setattr(asked, "about", lambda _: None)
    monkeypatch.setattr(asked, "_sums", lambda _: None)
    found = SimpleNamespace(
        estimate=SimpleNamespace(law=object()),
        weighed=None,
        name=further,
        explanation=None,
        evidence=700.0 + gained,
    )
    path: Any = SimpleNamespace(
        chosen=["payload", "thrust_asymmetry"], current=SimpleNamespace(evidence=700.0)
    )
    null: Any = SimpleNamespace(evidence=500.0)
    assert asked._takes_up(found, path, null) is expected
    # With the one that leaves such a thing, not with what else was named; of the model's effects the change counts.
    assert all(given == (["thrust_asymmetry"], {"waves": None}) for given in compared)
    asked.passes_over_none = True
    assert not asked._takes_up(found, path, null), "where that is all that would be left to name"


@pytest.mark.parametrize(
    ("predicted", "strict", "withheld", "further", "runs", "taken"),
    [
        # The search; with further names that cost little; with those that take up what earlier ones get wrong.
        ("X", False, True, {2}, ["", "looks", "looks all"], 2),
        ("X", False, True, {1, 2}, ["", "looks", "looks all"], 2),
        ("X", False, True, {1}, ["", "looks", "looks all"], 1),
        ("X", False, True, set(), ["", "looks", "looks all"], 0),
        # Names that are given as they are need no others.
        ("X", False, False, {2}, ["", "looks"], 0),
        # With names that cost little nothing is predicted.
        (["X", None], False, True, {2}, ["", "looks"], 1),
        # Nothing is predicted, or nothing that costs little may be left out.
        (None, False, True, {2}, [""], 0),
        ("X", True, True, {2}, [""], 0),
    ],
)
def test_what_takes_up_is_looked_at_before_names_are_not_given_for_what_they_leave(
    predicted, strict, withheld, further, runs, taken, monkeypatch
):
    made: list[str] = []

    class Search:
        def __init__(self, *_: object, **__: object) -> None:
            self.names, self.looks_further, self.passes_over_none = SimpleNamespace(), False, False

        def begin(self, *_: object) -> object:
            return object()

        def run(self, *_: object) -> SimpleNamespace:
            how = [w for w, on in (("looks", self.looks_further), ("all", self.passes_over_none)) if on]
            made.append(" ".join(how))
            law = SimpleNamespace(law=None)
            told = predicted[len(made) - 1] if isinstance(predicted, list) else predicted
            return SimpleNamespace(predicted=told, number=len(made) - 1, estimate=law)

    monkeypatch.setattr(answer, "ForceSearch", Search)
    for name in ("leaves_force", "fitted_alone", "white"):
        monkeypatch.setattr(answer, name, lambda *_: True)
    monkeypatch.setattr(answer, "fitted_over_parts", lambda asked, first, windows: (first, windows))
    monkeypatch.setattr(answer, "withheld", lambda *_, chance: withheld and not chance)
    monkeypatch.setattr(answer, "goes_further", lambda again, before: again.number in further)
    monkeypatch.setattr(answer, "state_with", lambda asked, state, over, result, *_, chance: result.number)
    asked: Any = SimpleNamespace(floor=None, most=4, tolerance=SimpleNamespace(strict=strict))
    state: Any = SimpleNamespace(windows=None, first=None, refuted=None, current=None, but=lambda **_: None)
    found = answer._with_force(asked, state, SimpleNamespace(closed_loop=False))
    assert found is not None and found[0] == taken
    assert made == runs
