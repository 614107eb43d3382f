"""A search that goes on from names which another one has found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import search as module
from tests.diagnosis.noise_law.scripted import Found, found, scripted

STEPS = [
    {"verdict": "named", "effects": ["payload"], "p_value": 0.01},
    {"verdict": "named", "effects": ["waves"], "p_value": 0.02},
    {"verdict": "unknown", "effects": [], "p_value": 0.03},
]
NAMED = found(100.0, "payload", "waves")
NULL = found(-1000.0)


def begun(monkeypatch, further: Any = None) -> tuple[Any, Any, list[str]]:
    """Return a search, where the one before it ended, and what is done."""
    asked, _ = scripted(monkeypatch, further or {})
    done: list[str] = []

    def settled(h: Any, steps: int | None = None) -> Found:
        done.append(f"settled {h.name or 'nothing'} {steps}")
        return h

    asked.fits = lambda: SimpleNamespace(settled=settled, told=lambda e: e, closer=lambda h: h)
    asked.judged = lambda first, law: done.append(f"judged {first} by {law}") or NULL
    first: Any = SimpleNamespace(fitted=SimpleNamespace(sigma=None))
    before: Any = SimpleNamespace(steps=STEPS, tried=(), groups=(), p_value=0.5, first=first)
    asked.windows = asked.sigma = asked.response = asked.cell = "given"
    begun: Any = SimpleNamespace(explanation="the first", law="all axes")
    monkeypatch.setattr(module, "first_law", lambda *given: begun if given[1:] == ("given",) * 4 else None)
    return asked, before, done


def both(asked: Any, before: Any, most: int) -> Any:
    path = asked.changed(NAMED, before)
    return path and asked.go_on(path, None, before, most)


def test_names_that_are_all_needed_stay_as_they_are(monkeypatch):
    asked, before, done = begun(monkeypatch)
    of: list[Any] = []
    monkeypatch.setattr(module, "no_longer_needed", lambda these, *_: of.append(list(these)))
    assert both(asked, before, 4) is None
    # All of them are asked for, the last one too; and nothing is compared with the fit without any.
    assert of == [["payload", "waves"]] and done == ["settled waves None"]


def test_the_search_goes_on_without_a_further_name_that_costs_little(monkeypatch):
    asked, before, _ = begun(monkeypatch, {("payload",): []})
    of: list[Any] = []

    def little(these: Any, current: Any, refit: Any, pays: Any) -> Any:
        of.append((list(these), current.explanation.effects, pays))
        return ("waves", found(40.0, "payload")) if these else None

    monkeypatch.setattr(module, "costs_little", little)
    ended = both(asked, before, 4)
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [("named", ["payload"])]
    assert ended.last.effects == ("payload",)
    # The first name is not asked for, however little it costs.
    assert of == [(["waves"], ("payload", "waves"), print), ([], ("payload",), print)]


def test_without_a_needless_name_the_search_goes_on(monkeypatch):
    further = {("waves",): [found(900.0, "waves", "tether")], ("waves", "tether"): []}
    asked, before, done = begun(monkeypatch, further)
    asked.usable.append("tether")
    monkeypatch.setattr(
        module,
        "no_longer_needed",
        lambda these, *_: ("payload", found(101.0, "waves")) if "payload" in these else None,
    )
    ended = both(asked, before, 2)
    assert [(s["verdict"], s["effects"], s["p_value"]) for s in ended.steps] == [
        ("named", ["waves"], 0.02),
        ("named", ["tether"], 1e-9),
    ]
    assert ended.last.effects == ("waves", "tether") and ended.tried == [] and ended.p_value == 0.5
    # What is without a name may have a force in degrees of freedom in which the names leave none.
    judged = "judged the first by all axes"
    assert (
        done[:3] == ["settled waves None", judged, f"settled nothing {module.NULL_STEPS}"]
        and ended.stands_out
    )
    # No more names than were asked for.
    assert [s["effects"] for s in both(asked, before, 1).steps] == [["waves"]]


def test_where_no_name_is_needed_none_is_left(monkeypatch):
    asked, before, _ = begun(monkeypatch, {(): [found(9.0, "tether")]})
    left = {"payload": found(101.0, "waves"), "waves": found(102.0)}
    monkeypatch.setattr(
        module, "no_longer_needed", lambda these, *_: (these[0], left[these[0]]) if these else None
    )
    path = asked.changed(NAMED, before)
    assert path.chosen == [] and path.steps == [] and path.current.evidence == 102.0


def test_what_could_not_be_told_apart_before_is_compared_again(monkeypatch):
    """A needless name elsewhere decides no tie."""
    asked, before, _ = begun(monkeypatch)
    lead, rival, wrong = (SimpleNamespace(effects=(n,)) for n in ("waves", "tether", "gyro_bias"))
    before.groups = ((lead, rival, wrong),)
    monkeypatch.setattr(
        module,
        "refitted",
        lambda *given, whole: found(99.0, "payload", "tether") if given[5] is rival else None,
    )
    monkeypatch.setattr(module, "no_longer_needed", lambda *_: None)
    assert asked.changed(NAMED, before) is None
    monkeypatch.setattr(
        module,
        "no_longer_needed",
        lambda these, *_: ("payload", found(101.0, "waves")) if "payload" in these else None,
    )
    path = asked.changed(NAMED, before)
    assert [(s["verdict"], s["effects"]) for s in path.steps] == [("ambiguous", ["waves", "tether"])]
    assert [[e.effects[-1] for e in g] for g in path.groups] == [["waves", "tether"]]


@pytest.mark.parametrize(("evidence", "order"), [(99.0, ["waves", "tether"]), (103.0, ["tether", "waves"])])
def test_a_rival_of_a_name_is_told_with_it(monkeypatch, evidence, order):
    asked, before, _ = begun(monkeypatch)
    asked._tested = lambda *_: SimpleNamespace(p_value=1.0, scores={})
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    rival = SimpleNamespace(effects=("tether",))
    monkeypatch.setattr(module, "rivals_tried", lambda *_: {"waves": [rival]})
    offered: list[Any] = []

    def as_good(these: Any, current: Any, rivals: Any, refit: Any) -> Any:
        offered.append([e.effects[-1] for e in rivals["waves"]])
        return ("waves", found(evidence, "payload", "tether")) if rivals["waves"] else None

    monkeypatch.setattr(module, "as_good_in_place", as_good)
    ended = both(asked, before, 2)
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [
        ("named", ["payload"]),
        ("ambiguous", order),
    ]
    assert [[e.effects[-1] for e in g] for g in ended.groups] == [order]
    assert ended.last.effects[-1] == order[0] and offered[0] == ["tether"] and offered[-1] == []


def test_every_rival_that_does_as_well_is_told_three_in_a_group_at_most(monkeypatch):
    asked, before, _ = begun(monkeypatch)
    tied = ["tether", "gyro_bias", "payload_2", "cg_offset"]
    of = [SimpleNamespace(effects=(n,)) for n in tied]
    rivals = {"waves": of[:3], "payload": of[3:]}
    monkeypatch.setattr(module, "rivals_tried", lambda *_: rivals)

    def as_good(these: Any, current: Any, able: Any, refit: Any) -> Any:
        return next(((n, found(99.0, n, e.effects[-1])) for n in these for e in able[n]), None)

    monkeypatch.setattr(module, "as_good_in_place", as_good)
    path = asked.changed(NAMED, before)
    assert [s["effects"] for s in path.steps] == [["payload", "cg_offset"], ["waves", "tether", "gyro_bias"]]


@pytest.mark.parametrize(
    ("evidence", "order"), [(99.0, ["payload", "waves"]), (102.0, ["waves", "payload"]), (110.0, ["waves"])]
)
def test_of_two_names_of_which_one_is_needed_the_likelier_stays(monkeypatch, evidence, order):
    """Whichever went first, however far the model is wrong; and each comes back once."""
    asked, before, _ = begun(monkeypatch)
    asked.rest = lambda _: 50.0
    rival = SimpleNamespace(effects=("waves",))
    monkeypatch.setattr(module, "rivals_tried", lambda *_: {"payload": [rival], "waves": []})
    gone: list[str] = []

    def needless(these: Any, *_: Any) -> Any:
        if "waves" not in these or gone:
            return None
        gone.append("waves")
        return "waves", found(100.0, "payload")

    def as_good(these: Any, current: Any, able: Any, refit: Any) -> Any:
        free = "payload" in these and [e.effects[-1] for e in able["payload"]] == ["waves"]
        return ("payload", found(evidence, "waves")) if free else None

    monkeypatch.setattr(module, "no_longer_needed", needless)
    monkeypatch.setattr(module, "as_good_in_place", as_good)
    path = asked.changed(NAMED, before)
    assert [s["effects"] for s in path.steps] == [order] and path.needless == []
    assert path.chosen == order[:1] and path.current.evidence == (100.0 if evidence < 100.0 else evidence)


def test_what_gave_its_place_does_not_come_back(monkeypatch):
    asked, before, _ = begun(monkeypatch)
    rivals = {"payload": [SimpleNamespace(effects=("tether",))], "tether": []}
    rivals["tether"].append(SimpleNamespace(effects=("payload",)))
    monkeypatch.setattr(module, "rivals_tried", lambda *_: rivals)
    asked.rest = lambda _: 0.0

    def as_good(these: Any, current: Any, able: Any, refit: Any) -> Any:
        better = current.evidence + 10.0
        return next(
            ((n, found(better, "waves", e.effects[-1])) for n in these for e in able.get(n, ())), None
        )

    monkeypatch.setattr(module, "as_good_in_place", as_good)
    path = asked.changed(NAMED, before)
    assert path.chosen == ["tether", "waves"] and path.dropped == ["payload"] and path.needless == []
