"""Names that only take up what commands do between samples, told from names of what is there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import answer
from auvnn.diagnosis.noise_law.commands import in_place_of_names as in_place_of_names_module
from auvnn.diagnosis.noise_law.commands.in_place_of_names import (
    in_place_of_names,
    replaced,
    without_timed,
)
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.diagnosis.stages.state import State
from auvnn.estimation.prediction_error import FitError
from auvnn.logs import Log
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle, thinned

NAMES = ["net_buoyancy", "thrust_overshoot"]
STEP = 5


def of(hidden: dict[str, dict[str, float]], *, held: bool) -> tuple[GreyBox, Log]:
    """Return a model, and a log of it with what is hidden, at 5 Hz, its commands held or changed at 25 Hz."""
    model = GreyBox(small_vehicle())
    plant = model.with_effects(hidden) if hidden else model
    rate = 5.0 if held else 5.0 * STEP
    log = make_log(plant, runs=3, duration=30.0, rate=rate, noise=0.3, max_step=0.04)
    return model, log if held else thinned(log, STEP)


def ended(model: GreyBox, log: Log, order: list[str]) -> tuple[Any, State]:
    """Return what is asked, and a search that has ended with both names, found in some order."""
    windows, layout = windows_for(model, log), lay_out(model, NAMES)
    base = list(layout.nuisance)
    first = fit_hypothesis(layout, windows, base, ())
    path = tuple(fit_hypothesis(layout, windows, base, order[: k + 1]) for k in range(2))
    asked = SimpleNamespace(
        layout=layout, base=tuple(base), chooser=lambda w: Chooser(layout, w, lambda _: None)
    )
    return asked, State(windows, first, path[-1], chosen=tuple(order), path=path)


def overshoot(model: GreyBox) -> dict[str, float]:
    described = model.with_effects({"thrust_overshoot": {}}).effect("thrust_overshoot").parameters_of
    return {p.name: p.null + 3.0 * p.scale for p in described if not p.shape}


@pytest.mark.parametrize("order", [NAMES, NAMES[::-1]])
def test_an_overshoot_that_stands_for_commands_between_samples_gives_way(order):
    """Whichever comes first: then the explanation with the buoyancy alone is fitted."""
    found = in_place_of_names(*ended(*of({"net_buoyancy": {"force": 6.0}}, held=False), order))
    assert found is not None and found[0].effects == ("net_buoyancy",)
    assert found[1].name in ("ahead", "linear", "smooth") and found[1].share == pytest.approx(0.4, abs=0.15)


def test_names_of_what_is_there_stay():
    model = GreyBox(small_vehicle())
    both = {"net_buoyancy": {"force": 6.0}, "thrust_overshoot": overshoot(model)}
    assert in_place_of_names(*ended(*of(both, held=True), NAMES)) is None
    # Nor is the buoyancy given up for a law: it is in the explanation that is asked.
    assert in_place_of_names(*ended(*of({"net_buoyancy": {"force": 6.0}}, held=True), NAMES)) is None


@pytest.mark.parametrize(
    ("names", "leaves", "given"), [(1, False, True), (2, False, False), (0, True, False)]
)
def test_where_names_leave_nothing_a_law_that_spares_some_of_them_takes_their_place(
    names, leaves, given, monkeypatch
):
    """The search with the law must leave nothing with fewer names."""
    searched: list[Any] = []
    state: Any = SimpleNamespace(
        leaves_something=False,
        chosen=("net_buoyancy", "thrust_overshoot"),
        windows="held",
        current=None,
        interrupted=False,
    )
    monkeypatch.setattr(answer, "interval_of", lambda windows: 0.25)
    again = State("law", None, None, chosen=tuple(NAMES[:names]), failed={"waves": "no"})  # type: ignore[arg-type]
    again = again.step("unknown" if leaves else "adequate", [], 0.0)
    law = SimpleNamespace(
        name="smooth",
        applied=lambda w: f"{w}, smooth",
        to_dict=lambda: {"a": 1},
        path=lambda interval: ("smooth", interval),
    )
    monkeypatch.setattr(answer, "in_place_of_names", lambda *_: ("fewer", law))
    monkeypatch.setattr(answer, "replaced", lambda fewer, end: {"thrust_overshoot": "why"})
    monkeypatch.setattr(
        answer, "without", lambda asked, gone: SimpleNamespace(with_commands=lambda path: (*gone, path))
    )
    monkeypatch.setattr(answer, "search", lambda asked, windows: searched.append((asked, windows)) or again)
    asked: Any = SimpleNamespace(say=lambda _: None, commands=None)
    found = answer.answer_with_force(asked, state)
    assert searched == [(("thrust_overshoot", ("smooth", 0.25)), "held, smooth")], (
        "what names cost is worked out with commands that go so, too"
    )
    if given:
        assert found[1:] == ({"commands": {"a": 1}}, []) and found[0].chosen == again.chosen
        assert found[0].failed == {"waves": "no", "thrust_overshoot": "why"}
    else:
        assert found == (state, {}, [])
    # A search that cannot be solved costs no answer.
    monkeypatch.setattr(answer, "search", diverging)
    assert answer.answer_with_force(asked, state) == (state, {}, [])


def diverging(*_: Any) -> Any:
    raise FitError("free running grows without bound")


def test_a_look_that_cannot_be_solved_replaces_nothing(monkeypatch):
    asked, state = ended(*of({"net_buoyancy": {"force": 6.0}}, held=False), NAMES)
    for name in ("holding", "cost_at_best"):
        with monkeypatch.context() as there:
            there.setattr(in_place_of_names_module, name, diverging)
            assert in_place_of_names(asked, state) is None
    asked.chooser = lambda _: SimpleNamespace(without=diverging)
    assert without_timed(asked, state.but(path=(), tried=()), state.current) is None


def test_names_that_a_law_replaces_are_not_asked_for_again_and_it_is_said_why():
    end, before = (SimpleNamespace(effects=e) for e in (("waves", *NAMES), ("waves", "net_buoyancy")))
    gone = replaced(before, end)  # type: ignore[arg-type]
    assert [*gone] == ["thrust_overshoot"] and "law of the commands" in gone["thrust_overshoot"]
    assert replaced(end, end) == {}  # type: ignore[arg-type]


@pytest.mark.long
def test_the_answer_has_the_name_of_what_is_there_alone():
    model, log = of({"net_buoyancy": {"force": 6.0}}, held=False)
    found = diagnose(model, log, NAMES, advice=False, whiteness=False)
    assert found.verdict == "named" and found.missing == ["net_buoyancy"]
    assert found.stochastic["commands"]["between_samples"] != "held"
    row = next(c for c in found.candidates if c["effect"] == "thrust_overshoot")
    assert "law of the commands" in row["reason"]
