"""A search that goes on from names which another one has found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import search as module
from tests.diagnosis.noise_law.test_looking_ahead import Found, found, scripted

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

    asked.fits = lambda: SimpleNamespace(settled=settled, told=lambda e: e)
    asked.judged = lambda first, law: NULL
    before: Any = SimpleNamespace(steps=STEPS, tried=(), p_value=0.5)
    return asked, before, done


def test_names_that_are_all_needed_stay_as_they_are(monkeypatch):
    asked, before, done = begun(monkeypatch)
    of: list[Any] = []
    monkeypatch.setattr(module, "no_longer_needed", lambda these, *_: of.append(list(these)))
    assert asked.from_names(NAMED, None, before, 4) is None
    # All of them are asked for, the last one too; and nothing is compared with the fit without any.
    assert of == [["payload", "waves"]] and done == ["settled waves None"]


def test_without_a_needless_name_the_search_goes_on(monkeypatch):
    further = {("waves",): [found(900.0, "waves", "tether")], ("waves", "tether"): []}
    asked, before, done = begun(monkeypatch, further)
    asked.usable.append("tether")
    monkeypatch.setattr(
        module,
        "no_longer_needed",
        lambda these, *_: ("payload", found(101.0, "waves")) if "payload" in these else None,
    )
    ended = asked.from_names(NAMED, None, before, 2)
    assert [(s["verdict"], s["effects"], s["p_value"]) for s in ended.steps] == [
        ("named", ["waves"], 0.02),
        ("named", ["tether"], 1e-9),
    ]
    assert ended.last.effects == ("waves", "tether") and ended.tried == [] and ended.p_value == 0.5
    assert done[:2] == ["settled waves None", f"settled nothing {module.NULL_STEPS}"]
    # No more names than were asked for.
    assert [s["effects"] for s in asked.from_names(NAMED, None, before, 1).steps] == [["waves"]]


def test_where_no_name_is_needed_none_is_left(monkeypatch):
    asked, before, _ = begun(monkeypatch, {(): [found(9.0, "tether")]})
    left = {"payload": found(101.0, "waves"), "waves": found(102.0)}
    monkeypatch.setattr(
        module, "no_longer_needed", lambda these, *_: (these[0], left[these[0]]) if these else None
    )
    ended = asked.from_names(NAMED, None, before, 4)
    assert ended.steps == [] and ended.last.effects == ()


@pytest.mark.parametrize(("evidence", "order"), [(99.0, ["waves", "tether"]), (103.0, ["tether", "waves"])])
def test_a_rival_of_a_name_is_told_with_it(monkeypatch, evidence, order):
    asked, before, _ = begun(monkeypatch)
    asked._tested = lambda *_: SimpleNamespace(p_value=1.0, scores={})
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    rival = SimpleNamespace(effects=("tether",))
    monkeypatch.setattr(module, "rivals_tried", lambda these, tried: {"waves": [rival]})
    offered: list[Any] = []

    def as_good(these: Any, current: Any, rivals: Any, refit: Any) -> Any:
        offered.append([e.effects[-1] for e in rivals["waves"]])
        return ("waves", found(evidence, "payload", "tether")) if rivals["waves"] else None

    monkeypatch.setattr(module, "as_good_in_place", as_good)
    ended = asked.from_names(NAMED, None, before, 2)
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [
        ("named", ["payload"]),
        ("ambiguous", order),
    ]
    assert [[e.effects[-1] for e in g] for g in ended.groups] == [order]
    assert ended.last.effects[-1] == order[0] and offered[0] == ["tether"] and offered[-1] == []
