"""Where a search has ended with names, what effects without a name would move is part of their standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.noise_law import search as force_search
from auvnn.diagnosis.selection.moved_by_unnamed import Moved
from auvnn.diagnosis.stages import unnamed_effects as module
from auvnn.diagnosis.stages.state import State
from auvnn.diagnosis.stages.unnamed_effects import beside_unnamed
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.scripted import found, scripted
from tests.small_logs import make_log, small_vehicle

# A vertical current of a centimetre a second pushes as a buoyancy of half a newton does.
FORCE, DRIFT = 15.0, 0.01


@dataclass(frozen=True)
class Fit:
    """An explanation, as far as it is looked at."""

    effects: tuple[str, ...] = ()
    under_law: Any = None
    systematic: Any = None
    beside: tuple[str, ...] = ()


class Asked:
    """What is asked, with tests that are written down."""

    usable, base = ("payload", "waves", "tether", "trapped_water"), ("inertia",)

    def __init__(self) -> None:
        self.tested: list[list[str]] = []
        self.say = lambda _: None

    def tests(self, windows: Any) -> Any:
        def tested(current: Any, remaining: list[str], base: list[str], chosen: list[str]) -> str:
            self.tested.append(remaining)
            assert base == ["inertia", *chosen] and chosen == [*current.effects]
            return "made now"

        return tested


def state(fit: Fit, **more: Any) -> Any:
    return State(None, Fit(), fit, chosen=fit.effects, **more)  # type: ignore[arg-type]


@pytest.fixture
def moved(monkeypatch) -> list[Any]:
    given: list[Any] = []

    def by(windows: Any, current: Fit, tested: Any, base: list[str]) -> Any:
        given.append((current.effects, tested, base))
        return Moved(("waves",), np.array([0.5]))

    monkeypatch.setattr(module, "moved_by_unnamed", by)
    return given


def test_tests_that_were_made_beside_the_names_are_taken_and_others_are_not(moved):
    asked: Any = Asked()
    fit, other = Fit(("payload",)), Fit(("payload",), systematic=0.0)
    told = beside_unnamed(asked, state(fit, last_tests=(fit, "made before")))
    assert moved == [(("payload",), "made before", ["inertia", "payload"])] and asked.tested == []
    np.testing.assert_array_equal(told.current.systematic, [0.5])
    assert told.current.beside == ("waves",)
    rival: Any = Fit(("tether",))
    beside_unnamed(
        asked,
        state(fit, last_tests=(other, "made before"), withdrawn=("waves",), groups=((fit, rival),)),
    )
    assert moved[1][1] == "made now" and asked.tested == [["trapped_water"]]


@pytest.mark.parametrize("fit", [Fit(), Fit(("payload",), under_law="told there")])
def test_without_names_and_where_it_was_told_before_nothing_changes(moved, fit):
    before = state(fit)
    assert beside_unnamed(Asked(), before) is before and moved == []  # type: ignore[arg-type]


def test_tests_that_cannot_be_solved_leave_the_answer_as_it_was(monkeypatch):
    def unsolved(*_: Any) -> Any:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(module, "moved_by_unnamed", unsolved)
    before = state(Fit(("payload",)))
    assert beside_unnamed(Asked(), before) is before  # type: ignore[arg-type]


@pytest.mark.parametrize("most", [1, 4])
def test_beside_a_force_what_was_named_or_passed_is_not_asked_for(monkeypatch, most):
    asked, _ = scripted(monkeypatch, {(): [found(10.0, "payload")]})
    told: list[Any] = []
    monkeypatch.setattr(
        force_search, "moved_by_unnamed", lambda *given: told.append(given) or np.array([0.5])
    )
    monkeypatch.setattr(force_search, "widened", lambda of, by: SimpleNamespace(effects=of.effects, by=by))
    asked._tested = lambda current, remaining, *_: SimpleNamespace(p_value=0.0, asked=remaining)
    asked.base = ["inertia"]
    # What is answered are the likeliest values, and what is moved are these.
    there = found(10.3, "payload")
    asked.fits = lambda: SimpleNamespace(told=lambda e: e, closer=lambda h: there if h.name else h)
    ended = asked.run(found(-1000.0), [], most)
    (_, current, tested, base) = told[0]
    assert len(told) == 1 and current is there.explanation and base == ["inertia", "payload"]
    assert tested.asked == ["thrust_asymmetry", "trapped_water", "waves"]
    assert ended.last.effects == ("payload",) and ended.last.by == [0.5]


def test_beside_a_force_nothing_is_moved_where_nothing_is_named(monkeypatch):
    asked, _ = scripted(monkeypatch, {})
    monkeypatch.setattr(force_search, "moved_by_unnamed", lambda *_: pytest.fail("there is nothing to move"))
    assert asked.run(found(-1000.0), [], 4).steps == []


def test_an_interval_holds_the_truth_where_a_second_cause_may_not_be_named():
    """One name at most: a buoyancy takes up what a vertical current does, and says how far that may be."""
    model = GreyBox(small_vehicle())
    hidden = {"net_buoyancy": {"force": FORCE}, "ocean_current": {"v_down": DRIFT}}
    log = make_log(model.with_effects(hidden), runs=3, duration=30.0, noise=1.0)
    answer = diagnose(
        model,
        log,
        ["net_buoyancy", "ocean_current"],
        max_effects=1,
        advice=False,
        whiteness=False,
        costs=False,
    )
    assert answer.missing == ["net_buoyancy"]
    told = next(c for c in answer.candidates if c["effect"] == "net_buoyancy")["parameters"]["force"]
    (allowed,) = [w for w in answer.warnings if w.startswith("not named, but likely beside what is named: ")]
    assert ": ocean_current (" in allowed and allowed.endswith("the standard errors allow for this")
    assert 0.3 < abs(told["value"] - FORCE) < 1.96 * told["std"] < 1.0
