"""A round of the search: members of groups asked for again, and what earlier names leave passed over."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.selection.choose import Choice
from auvnn.diagnosis.stages import search_round as module
from auvnn.diagnosis.stages.search_round import search_round
from auvnn.diagnosis.stages.state import State

USABLE = ["payload", "waves", "tether", "thrust_asymmetry", "constant_force"]


def fit(error: float, *effects: str) -> Any:
    return SimpleNamespace(effects=effects, squared_error=lambda _: error)


class Asked:
    """What is asked, with a chooser whose choices are given by what it may choose from."""

    def __init__(self, choices: list[Choice]) -> None:
        self.usable, self.base, self.most = USABLE, [], 5
        self.say, self.choices, self.offered = lambda _: None, choices, []
        self.gone: list[str] = []
        self.stated = {"waves": np.ones(1)}

    def tests(self, windows: Any) -> Any:
        def tested(current: Any, remaining: Any, *_: Any, **__: Any) -> Any:
            return SimpleNamespace(p_value=0.0, scores=dict.fromkeys(remaining), at=None, alike=None)

        return tested

    def chooser(self, windows: Any) -> Any:
        def choose(scores: Any, *_: Any) -> Choice:
            self.offered.append([*scores])
            return self.choices[len(self.offered) - 1]

        return SimpleNamespace(choose=choose, withdrawn=lambda best, base: (best, [*self.gone]))


def begun(*chosen: str, groups: Any = (), **more: Any) -> State:
    first: Any = SimpleNamespace(
        fitted=SimpleNamespace(sigma=np.ones(18)), effects=(), squared_error=lambda _: 100.0
    )
    given: Any = {
        "windows": None, "first": first, "current": fit(60.0, *chosen), "chosen": chosen, "groups": groups,
        "table": {"x": None}, **more,
    }  # fmt: skip
    return State(**given)


def named(best: Any, *rivals: Any) -> Choice:
    return Choice("ambiguous" if rivals else "named", best, [], [best, *rivals] if rivals else [])


@pytest.fixture(autouse=True)
def whole_steps(monkeypatch):
    monkeypatch.setattr(module, "_finer", lambda asked, found, windows: (found, windows))
    # As in the log of an asymmetry that exerts a force of 1, of a further effect that exerts 1.5.
    monkeypatch.setattr(module, "exerts_less", lambda *given: given[-1] > 1.5)


TIED = (fit(60.0, "payload"), fit(60.0, "waves"), fit(60.0, "tether"))
STEP = {"verdict": "ambiguous", "effects": ["payload", "waves", "tether"], "p_value": 0.0}


def test_a_member_of_a_group_that_is_needed_beside_the_one_that_leads_is_no_rival_of_it():
    asked: Any = Asked([named(fit(30.0, "payload", "waves"))])
    state: Any = search_round(asked, begun("payload", groups=(TIED,), steps=(STEP,)))
    assert asked.offered == [["waves", "tether", "thrust_asymmetry", "constant_force"]]
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("ambiguous", ["payload", "tether"]), ("named", ["waves"]),
    ]  # fmt: skip
    assert [[e.effects[-1] for e in g] for g in state.groups] == [["payload", "tether"]]
    # Of two, the one that leads is left alone.
    pair = {**STEP, "effects": ["payload", "waves"]}
    asked = Asked([named(fit(30.0, "payload", "waves"))])
    state = search_round(asked, begun("payload", groups=(TIED[:2],), steps=(pair,)))
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("named", ["payload"]),
        ("named", ["waves"]),
    ]
    assert state.groups == () and state.chosen == ("payload", "waves")


@pytest.mark.parametrize("promised", [True, False])
def test_where_the_tests_promise_too_little_nothing_is_fitted(promised):
    asked: Any = Asked([named(fit(30.0, "payload", "waves"))])
    state, seen = begun("payload"), []

    def promising(at: Any, tested: Any) -> bool:
        seen.append((at, [*tested]))
        return promised

    after = search_round(asked, state, promising)
    assert seen == [(state, ["waves", "tether", "thrust_asymmetry", "constant_force"])]
    assert (after is state) is not promised and len(asked.offered) == promised


def test_a_member_beside_which_the_one_that_leads_is_needless_takes_its_place():
    asked: Any = Asked([named(fit(30.0, "payload", "tether", "waves"))])
    asked.gone = ["payload"]
    pair, later = (
        {**STEP, "effects": ["payload", "waves"]},
        {**STEP, "verdict": "named", "effects": ["tether"]},
    )
    begins = begun("payload", "tether", groups=(TIED[:2],), steps=(pair, later))
    state: Any = search_round(asked, begins)
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("named", ["waves"]),
        ("named", ["tether"]),
    ]
    assert state.withdrawn == ("payload",) and state.groups == ()
    # Of two effects that are named together the other one stays where it is.
    asked = Asked([named(fit(30.0, "payload", "tether", "constant_force", "waves"))])
    asked.gone = ["payload"]
    state = search_round(asked, begins)
    assert [s["effects"] for s in state.steps] == [["waves"], ["tether"], ["constant_force"]]
    # What is needless besides is said to be withdrawn.
    asked = Asked([named(fit(30.0, "payload", "tether", "waves"))])
    asked.gone = ["payload", "tether"]
    state = search_round(asked, begins)
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("named", ["waves"]), ("named", ["tether"]), ("withdrawn", ["tether"]),
    ]  # fmt: skip


def test_a_member_of_a_group_is_in_no_second_one():
    alike = fit(31.0, "payload", "waves"), fit(31.0, "payload", "constant_force")
    asked: Any = Asked([named(fit(30.0, "payload", "thrust_asymmetry"), *alike)])
    state: Any = search_round(asked, begun("payload", groups=(TIED,), steps=(STEP,)))
    assert [s["effects"] for s in state.steps] == [STEP["effects"], ["thrust_asymmetry", "constant_force"]]
    asked = Asked([named(fit(30.0, "payload", "thrust_asymmetry"), alike[0])])
    state = search_round(asked, begun("payload", groups=(TIED,), steps=(STEP,)))
    assert [(s["verdict"], s["effects"]) for s in state.steps[1:]] == [("named", ["thrust_asymmetry"])]
    assert len(state.groups) == 1


def test_so_is_one_that_came_together_with_another_effect():
    both, other = (
        fit(50.0, "thrust_asymmetry", "constant_force", "tether"),
        fit(55.0, "thrust_asymmetry", "tether"),
    )
    asked: Any = Asked([named(both), named(other)])
    assert search_round(asked, begun("thrust_asymmetry")).chosen == ("thrust_asymmetry", "tether")
    assert asked.offered[1] == ["payload", "waves", "tether"]


@pytest.mark.parametrize(
    ("chosen", "error", "passed"),
    [
        # The asymmetry took 40 of 100: half as much is what its form may get wrong.
        (("thrust_asymmetry",), 41.0, True),
        (("thrust_asymmetry",), 39.0, False),
        (("thrust_asymmetry", "payload"), 49.0, False),
        (("thrust_asymmetry", "payload"), 51.0, True),
        (("payload",), 59.0, False),
    ],
)
def test_a_small_constant_force_beside_an_asymmetry_of_the_thrust_is_passed_over(chosen, error, passed):
    bias, other = fit(error, *chosen, "constant_force"), fit(58.0, *chosen, "tether")
    asked: Any = Asked([named(bias), named(other)])
    state: Any = search_round(asked, begun(*chosen))
    assert state.chosen[-1] == ("tether" if passed else "constant_force")
    assert len(asked.offered) == (2 if passed else 1) and "constant_force" in asked.offered[0]
    assert not passed or "constant_force" not in asked.offered[1]


def test_so_is_one_that_explains_much_and_exerts_less_than_the_form_that_leaves_it(monkeypatch):
    asked_of = []

    def less(found, windows, further, names, stated, times):
        asked_of.append((further, names, [*stated], times))
        return further == "constant_force"

    monkeypatch.setattr(module, "exerts_less", less)
    chosen = ("payload", "thrust_asymmetry")
    bias, other = fit(20.0, *chosen, "constant_force"), fit(25.0, *chosen, "tether")
    asked: Any = Asked([named(bias), named(other)])
    assert search_round(asked, begun(*chosen)).chosen[-1] == "tether"
    # With the one that leaves such a thing, not with what else was named.
    assert asked_of == [("constant_force", ["thrust_asymmetry"], ["waves"], 1.0)]


def test_one_that_explains_little_and_exerts_more_than_twice_what_the_form_does_is_given(
    monkeypatch,
):
    monkeypatch.setattr(module, "exerts_less", lambda *given: given[-1] > 2.0)
    asked: Any = Asked([named(fit(58.0, "thrust_asymmetry", "constant_force"))])
    assert search_round(asked, begun("thrust_asymmetry")).chosen[-1] == "constant_force"


def test_what_comes_in_the_place_of_one_that_is_passed_over_may_be_passed_over_too(monkeypatch):
    monkeypatch.setattr(module, "exerts_less", lambda *_: True)
    leaves = lambda name, chosen: [*chosen] if name in ("constant_force", "waves") else []  # noqa: E731
    monkeypatch.setattr(module, "forms_that_leave", leaves)
    chosen = ("thrust_asymmetry",)
    fits = [fit(20.0, *chosen, "constant_force"), fit(21.0, *chosen, "waves"), fit(25.0, *chosen, "tether")]
    asked: Any = Asked([named(e) for e in fits])
    assert search_round(asked, begun(*chosen)).chosen[-1] == "tether"
    assert asked.offered[1:] == [["payload", "waves", "tether"], ["payload", "tether"]]


@pytest.mark.parametrize("most", [1, 5])
def test_a_round_that_ends_the_search_keeps_its_tests_with_the_fit_beside_which_they_were_made(
    monkeypatch, most
):
    """Whether no further name may be given, or none was found."""
    monkeypatch.setattr(module, "rest", lambda *_: "adequate")
    asked: Any = Asked([Choice("unknown", None, [], [])])
    asked.most = most
    state = begun("payload")
    after = search_round(asked, state)
    assert after.ended and after.last_tests is not None and after.last_tests[0] is state.current
    assert [*after.last_tests[1].scores] == ["waves", "tether", "thrust_asymmetry", "constant_force"]
    assert len(asked.offered) == (most > 1)
