"""The course of a search together with a force: what is named, passed over, given up, exchanged and told together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law import search as module
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.rounds import path as path_module
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.score_tests.null_tests import Tested
from tests.diagnosis.noise_law.scripted import (
    Effects,
    found,
    names,
    scripted,
)


def test_the_search_begins_with_what_the_likeliest_pairs_have_in_common(monkeypatch):
    payload, uneven, waves = found(10.0, "payload"), found(8.0, "thrust_asymmetry"), found(-900.0, "waves")
    further = {
        (): [payload, uneven, waves],
        ("payload",): [found(380.0, "payload", "thrust_asymmetry")],
        ("thrust_asymmetry",): [found(379.0, "thrust_asymmetry", "trapped_water")],
        ("thrust_asymmetry", "trapped_water"): [],
    }
    asked, rounds = scripted(monkeypatch, further)
    ended = asked.run(found(-1000.0), [], 4)
    assert [s["effects"] for s in ended.steps] == [["thrust_asymmetry"], ["trapped_water"]]
    # The third of those that were fitted at first runs off: it is not told, and costs nothing.
    assert [e.effects for e in ended.tried] == [("payload",), ("thrust_asymmetry",)]
    # A further name is fitted from where it was as the first one, too.
    first, second = ["payload"], ["thrust_asymmetry"]
    assert [at.chosen for at in rounds] == [[], first, second, second, [*second, "trapped_water"]]
    assert rounds[0].begins == {} and [*rounds[-1].begins] == ["payload", "thrust_asymmetry", "waves"]
    # So is told what it brought then.
    gained = {"payload": 1010.0, "thrust_asymmetry": 1008.0, "waves": 100.0}
    assert rounds[0].alone == {} and rounds[1].alone == rounds[-1].alone == gained
    # Of one name alone no pair is asked for.
    asked, rounds = scripted(monkeypatch, further)
    assert [s["effects"] for s in asked.run(found(-1000.0), [], 1).steps] == [["payload"]]


def test_what_is_left_is_compared_at_the_inertia_without_any_name(monkeypatch):
    """A gain of the thrust that scales the inertia too explains no acceleration, however small the force is with it."""
    asked, _ = scripted(monkeypatch, {(): [found(10.0, "payload")], ("payload",): []})
    monkeypatch.setattr(module, "in_newtons", lambda law, at: (law.axes, at.effects))
    ended: Any = asked.run(found(-1000.0), [], 4)
    assert ended.first_law == ended.compared == (None, ())
    assert ended.estimate.law == (None, ("payload",))


def test_what_takes_up_what_an_earlier_name_gets_wrong_leaves_its_place_to_the_next(monkeypatch):
    further = {
        (): [found(10.0, "payload")],
        ("payload",): [
            found(500.0, "payload", "thrust_asymmetry"),
            found(480.0, "payload", "constant_force"),
            found(470.0, "payload", "trapped_water"),
        ],
        ("payload", "trapped_water"): [],
    }
    asked, _ = scripted(monkeypatch, further)
    asked.usable.append("constant_force")
    asked._takes_up = lambda h, *_: h.name == "thrust_asymmetry"
    # A constant force is known to be confused with what was passed over, and takes up the same.
    assert [s["effects"] for s in asked.run(found(-1000.0), [], 4).steps] == [["payload"], ["trapped_water"]]
    # Where all of them do, the search ends, and they are averaged with what was named.
    asked, _ = scripted(monkeypatch, further)
    asked.usable.append("constant_force")
    asked._takes_up = lambda *_: True
    assert [s["effects"] for s in asked.run(found(-1000.0), [], 4).steps] == [["payload"]]
    assert [effects[-1] for effects in asked.averaged_with[0]] == [
        "thrust_asymmetry", "constant_force", "trapped_water",
    ]  # fmt: skip


def test_what_is_fitted_beside_the_names_and_not_named_is_averaged_with_them(monkeypatch):
    further = {
        (): [found(10.0, "payload")],
        ("payload",): [found(14.0, "payload", "waves"), found(9.0, "payload", "trapped_water")],
    }
    asked, _ = scripted(monkeypatch, further, good=0)
    assert [s["effects"] for s in asked.run(found(-1000.0), [], 4).steps] == [["payload"]]
    assert asked.averaged_with == [[("payload", "waves"), ("payload", "trapped_water")]]
    # Without any name there is nothing to average; nor is there where no further one was asked for.
    for given, most in (({(): []}, 4), ({(): [found(10.0, "payload")]}, 1)):
        asked, _ = scripted(monkeypatch, given)
        asked.run(found(-1000.0), [], most)
        assert asked.averaged_with == [[]]


@pytest.mark.parametrize(
    ("pays", "waves", "expected"), [(True, 20.0, True), (False, 20.0, False), (True, 90.0, False)]
)
def test_the_first_name_stands_out_where_it_pays_and_is_far_ahead(monkeypatch, pays, waves, expected):
    """Of the first round alone: a further name does not stand out because it is far ahead of those left."""
    further = {
        (): [found(-800.0, "payload"), found(-1000.0 + waves, "waves")],
        ("payload",): [found(500.0, "payload", "waves")],
        ("payload", "waves"): [],
    }
    asked, _ = scripted(monkeypatch, further)
    asked.names.paying = lambda likely, *_: likely if pays else []
    ended = asked.run(found(-1000.0), [], 4)
    assert [s["effects"] for s in ended.steps] == [["payload"], ["waves"]] and ended.stands_out is expected
    assert ended.explains is pays


def test_an_explanation_whose_free_running_diverges_costs_no_answer():
    def told(explanation: Effects) -> Effects:
        if "waves" in explanation.effects:
            raise np.linalg.LinAlgError("SVD did not converge")
        return explanation

    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.fits = lambda: SimpleNamespace(told=told)
    kept = asked._told([found(3.0, "tether"), found(2.0, "waves"), found(1.0, "payload")])
    assert [e.effects for e in kept] == [("tether",), ("payload",)]


def test_a_name_that_later_ones_make_needless_goes_and_the_search_goes_on(monkeypatch):
    further = {
        (): [found(10.0, "payload")],
        ("payload",): [found(500.0, "payload", "thrust_asymmetry")],
        ("payload", "thrust_asymmetry"): [],
        ("thrust_asymmetry",): [found(900.0, "thrust_asymmetry", "waves")],
        ("thrust_asymmetry", "waves"): [],
    }
    asked, rounds = scripted(monkeypatch, further)
    asked_of: list[tuple[Any, ...]] = []

    def needless(names: Any, current: Any, refit: Any) -> Any:
        asked_of.append((tuple(names), current.explanation.effects))
        return ("payload", found(499.0, "thrust_asymmetry")) if "payload" in names else None

    monkeypatch.setattr(path_module, "explains_an_axis", lambda *_: False)
    monkeypatch.setattr(module, "no_longer_needed", needless)
    tested: list[list[str]] = []
    asked._tested = lambda current, remaining, *_: tested.append(remaining) or SimpleNamespace(p_value=0.0)
    ended = asked.run(found(-1000.0), [], 2)
    assert [s["effects"] for s in ended.steps] == [["thrust_asymmetry"], ["waves"]]
    assert ended.last.effects == ("thrust_asymmetry", "waves")
    # The name that came last was sought beside the others: the earlier ones are asked for.
    assert asked_of == [
        (("payload",), ("payload", "thrust_asymmetry")),
        (("thrust_asymmetry",), ("thrust_asymmetry", "waves")),
    ]
    # It does not come back, and what was known of the first name is not known of the next one.
    assert [at.chosen for at in rounds[-2:]] == [["payload"], ["thrust_asymmetry"]]
    assert tested[-2] == ["trapped_water", "waves"] and not ended.explains
    # What would move the names is asked for beside both of them, at the end.
    assert tested[-1] == ["trapped_water"]


@pytest.mark.parametrize("lost", [True, False])
def test_a_tie_is_decided_beside_all_names(monkeypatch, lost):
    further = {
        (): [found(10.0, "payload"), found(9.0, "trapped_water")],
        ("payload",): [found(500.0, "payload", "waves")],
        ("trapped_water",): [],
        ("payload", "waves"): [],
    }
    asked, _ = scripted(monkeypatch, further)
    scores = {
        "thrust_asymmetry": SimpleNamespace(evidence=30.0, degrees=1),
        "x": SimpleNamespace(evidence=90.0, degrees=0),
    }
    remained: list[list[str]] = []
    asked._tested = lambda current, remaining, *_: (
        remained.append(remaining) or SimpleNamespace(p_value=0.0, scores=scores)
    )
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good)
    monkeypatch.setattr(name_after_name, "decided", lambda good, *_: good)
    given: list[Any] = []

    wholes: list[bool] = []
    monkeypatch.setattr(module, "refitted", lambda *_, whole: wholes.append(whole))

    def those(layout: Any, groups: Any, current: Any, refit: Any, rest: float) -> set[tuple[str, str]]:
        refit([("payload", groups[0][1])])
        given.append(([[e.effects for e in g] for g in groups], current.explanation.effects, rest))
        return {("payload", "trapped_water")} if lost else set()

    monkeypatch.setattr(module, "those_that_lose", those)
    ended = asked.run(found(-1000.0), [], 4)
    assert wholes == [True] and remained[-2] == ["thrust_asymmetry"]
    # What is no rival any more may move what was found.
    assert remained[-1] == ["thrust_asymmetry", *(["trapped_water"] if lost else [])]
    # What the best further effect promises, of those of which the log says anything.
    assert given == [([[("payload",), ("trapped_water",)]], ("payload", "waves"), 30.0)]
    first = ended.steps[0]
    assert (first["verdict"], first["effects"]) == (
        ("named", ["payload"]) if lost else ("ambiguous", ["payload", "trapped_water"])
    )
    assert len(ended.groups) == (0 if lost else 1)


def test_a_member_of_a_group_that_does_clearly_better_beside_all_names_leads_it(monkeypatch):
    further = {
        (): [found(10.0, "payload"), found(9.0, "trapped_water"), found(8.0, "net_buoyancy")],
        ("payload",): [found(500.0, "payload", "waves")],
        ("trapped_water",): [],
        ("payload", "waves"): [],
    }
    asked, _ = scripted(monkeypatch, further)
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good)
    monkeypatch.setattr(name_after_name, "decided", lambda good, *_: good)
    rests, given = iter([30.0, 20.0]), []
    asked.rest = lambda path: next(rests)
    better = found(560.0, "waves", "trapped_water")

    def instead(layout: Any, groups: Any, current: Any, refit: Any, rest: float) -> Any:
        given.append((current.explanation.effects, rest))
        return ("payload", better) if len(given) == 1 else None

    def lost(layout: Any, groups: Any, current: Any, refit: Any, rest: float) -> set[tuple[str, str]]:
        given.append((current.explanation.effects, rest))
        assert [[e.effects[-1] for e in g] for g in groups] == [["trapped_water", "net_buoyancy"]]
        return set()

    monkeypatch.setattr(module, "that_leads_instead", instead)
    monkeypatch.setattr(module, "those_that_lose", lost)
    ended = asked.run(found(-1000.0), [], 2)
    # The name that led has lost; what could not be told from it is compared with the one that leads now.
    assert [s["effects"] for s in ended.steps] == [["trapped_water", "net_buoyancy"], ["waves"]]
    assert ended.last.effects == ("waves", "trapped_water")
    before, after = ("payload", "waves"), ("waves", "trapped_water")
    assert given == [(before, 30.0), (after, 20.0), (after, 20.0)]


@pytest.mark.parametrize(
    ("evidence", "rest", "plainer", "expected"),
    [
        (560.0, 0.0, (), [["net_buoyancy"], ["thrust_asymmetry"], ["waves"]]),
        (502.0, 0.0, (), [["net_buoyancy", "payload"], ["thrust_asymmetry"], ["waves"]]),
        (499.0, 0.0, (), [["payload", "net_buoyancy"], ["thrust_asymmetry"]]),
        # It is better by 60: by more, or by less, than what another effect would still gain.
        (560.0, 59.0, (), [["net_buoyancy"], ["thrust_asymmetry"], ["waves"]]),
        (560.0, 61.0, (), [["payload", "net_buoyancy"], ["thrust_asymmetry"]]),
        (560.0, 61.0, ("net_buoyancy",), [["net_buoyancy"], ["thrust_asymmetry"], ["waves"]]),
    ],
)
def test_a_rival_that_does_better_beside_all_names_takes_the_place(
    monkeypatch, evidence, rest, plainer, expected
):
    further = {
        (): [found(10.0, "payload"), found(-400.0, "net_buoyancy"), found(-900.0, "waves")],
        ("payload",): [found(500.0, "payload", "thrust_asymmetry")],
        ("payload", "thrust_asymmetry"): [],
        ("net_buoyancy", "thrust_asymmetry"): [found(900.0, "thrust_asymmetry", "net_buoyancy", "waves")],
        ("net_buoyancy", "thrust_asymmetry", "waves"): [],
    }
    asked, _ = scripted(monkeypatch, further)
    asked.usable.append("net_buoyancy")
    asked._tested = lambda *_: SimpleNamespace(
        p_value=0.0, scores={"waves": SimpleNamespace(evidence=rest, degrees=1)}
    )
    monkeypatch.setattr(module, "effect_class", lambda _: SimpleNamespace(plainer=plainer, acts_with=()))
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    monkeypatch.setattr(
        module, "rivals_among", lambda known, null: {"payload": [h.explanation for h in known]}
    )
    given: list[Any] = []

    def as_good(names: Any, current: Any, rivals: Any, refit: Any) -> Any:
        able = [e.effects[-1] for e in rivals["payload"]]
        given.append((names, current.explanation.effects, able))
        if "payload" not in names or len(given) > 1:
            return None
        return "payload", found(evidence, "thrust_asymmetry", "net_buoyancy")

    monkeypatch.setattr(module, "as_good_in_place", as_good)
    ended = asked.run(found(-1000.0), [], 4)
    assert [s["effects"] for s in ended.steps] == expected
    first = (["payload"], ("payload", "thrust_asymmetry"), ["payload", "net_buoyancy", "waves"])
    assert given[0] == first and len(given) == 2
    # What has given its place, and what is tied, is not asked for again.
    if expected[0][0] == "net_buoyancy":
        assert given[1][0] == ["net_buoyancy", "thrust_asymmetry"] and "payload" not in given[1][2]


def test_what_was_fitted_without_a_name_is_not_fitted_again(monkeypatch):
    asked, _ = scripted(monkeypatch, {})
    asked._settled, fits = None, []
    monkeypatch.setattr(module, "refitted", lambda *given, **_: fits.append(given[2:]) or len(fits))
    current, other, rival = (
        found(1.0, "payload", "waves"),
        found(1.0, "payload", "waves"),
        Effects(("tether",)),
    )
    refit = asked._refit(current)
    assert refit([("waves", None), ("waves", rival), ("waves", None)]) == [1, 2, 1]
    assert asked._refit(current)([("waves", None), ("payload", None), ("waves", rival)]) == [1, 3, 2]
    # Another explanation with the same names is another one, and a fit that goes on to its end is.
    assert asked._refit(other)([("waves", None)]) == [4]
    assert asked._refit(current, whole=True)([("waves", None)]) == [5]
    assert [(given[0] is current, *given[2:]) for given in fits] == [
        (True, "waves", None),
        (True, "waves", rival),
        (True, "payload", None),
        (False, "waves", None),
        (True, "waves", None),
    ]


def test_tests_of_more_effects_serve_for_fewer_and_not_the_other_way_round(monkeypatch):
    made: list[list[str]] = []

    def tests(weighed: Any, remaining: list[str], *_: Any) -> Tested:
        made.append(remaining)
        scores: Any = {n: SimpleNamespace(degrees=1, p_value=0.5) for n in remaining}
        return Tested(scores, None, None)  # type: ignore[arg-type]

    monkeypatch.setattr(name_after_name, "NullTests", lambda *_: tests)
    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.layout, asked._tests, asked.about, asked.say = None, {}, lambda *_: None, lambda _: None
    current: Any = SimpleNamespace(explanation=None, estimate=SimpleNamespace(law=None), weighed=None)
    assert [*asked._tested(current, ["payload", "waves"], [], []).scores] == ["payload", "waves"]
    assert [*asked._tested(current, ["waves"], [], []).scores] == ["waves"]
    assert made == [["payload", "waves"]]
    assert [*asked._tested(current, ["waves", "tether"], [], []).scores] == ["waves", "tether"]
    assert made[1:] == [["waves", "tether"]]


def test_what_is_not_asked_for_is_no_further_name_though_it_was_fitted():
    current: Any = found(1.0, "payload")
    leaders = LeaderFits(None, None, print)  # type: ignore[arg-type]
    leaders.take(current, found(9.0, "payload", "trapped_water"))
    leaders.take(current, found(8.0, "payload", "waves"))
    at: Any = SimpleNamespace(
        current=current, chosen=["payload"], tested=SimpleNamespace(scores={"waves": None})
    )
    assert names(leaders._beside(at)) == ["waves"]


@pytest.mark.parametrize(("found_first", "expected"), [([], False), ([found(10.0, "payload")], True)])
def test_all_names_are_asked_whether_the_model_predicts_worse_with_them(monkeypatch, found_first, expected):
    asked, _ = scripted(monkeypatch, {(): found_first, ("payload",): []})
    asked.names.worsen = lambda named, null: (named.name, null.name) == ("payload", "")
    assert asked.run(found(-1000.0), [], 4).worsens is expected
