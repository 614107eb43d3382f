"""Searches together with a force of which every fit is written down beforehand."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from auvnn.diagnosis.noise_law import search as module
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.selection.moved_by_unnamed import Moved
from auvnn.executors.serial import SERIAL


@dataclass(frozen=True)
class Effects:
    """What an explanation supposes."""

    effects: tuple[str, ...]
    fitted: Any = field(default_factory=lambda: SimpleNamespace(model=None), compare=False)


@dataclass(frozen=True)
class Estimated:
    """An estimate, as far as it is looked at."""

    law: Any = field(default_factory=lambda: SimpleNamespace(axes=None), compare=False)


@dataclass(frozen=True)
class Found:
    """An explanation, as far as it is looked at."""

    evidence: float
    explanation: Effects
    estimate: Estimated = field(default_factory=Estimated)

    @property
    def name(self) -> str:
        """The effect that came last."""
        return self.explanation.effects[-1] if self.explanation.effects else ""

    @property
    def weighed(self) -> Effects:
        """The explanation, as there are no sums to weigh."""
        return self.explanation


def found(evidence: float, *effects: str) -> Any:
    return Found(evidence, Effects(effects))


NULL = found(-1000.0)


def names(order: Any) -> list[str]:
    return [h.name for h in order]


@dataclass
class Names:
    """Explanations with one name more, by those before them, in the place of what decides what is likely."""

    further: dict[tuple[str, ...], list[Any]] = field(default_factory=dict)

    def likely(self, at: Any, among: int, given: Any, odds: float) -> list[Any]:
        """Return all of them."""
        return given


def search(further: dict[tuple[str, ...], list[Any]]) -> Any:
    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.followed, asked.names = [], Names()
    asked._leaders = LeaderFits(None, None, print)  # type: ignore[arg-type]
    asked._settled = lambda h: h

    def one_round(null: Any, current: Any, chosen: Any, grouped: Any, fitted: Any) -> Any:
        asked.followed.append(*chosen)
        more = further.get(tuple(chosen))
        return None if more is None else SimpleNamespace(at=None, among=1, found=more)

    asked._round = one_round
    return asked


def scripted(
    monkeypatch, further: dict[tuple[str, ...], list[Any]], good: int | None = None
) -> tuple[Any, list[Any]]:
    """Return a search whose tests and fits are given, and the rounds that it asks for, as they come.

    After the first round so many of the fits, by default all, may be named.
    """
    rounds: list[Any] = []

    def fitted(at: Any, *_: Any) -> tuple[list[Any], list[Any]]:
        rounds.append(at)
        more = further.get(tuple(at.chosen), [])
        return more, more[:good] if at.chosen else more

    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.layout, asked.usable, asked.base, asked.looks_further = (
        SimpleNamespace(columns=defaultdict(lambda: range(1))),
        ["payload", "thrust_asymmetry", "trapped_water", "waves"],
        [],
        False,
    )
    asked._earlier, asked._alone = {}, {}
    asked.names = SimpleNamespace(
        good=print,
        sure=lambda *_: 1e-9,
        likely=lambda at, among, given, odds: given,
        paying=lambda likely, *_: likely,
        pays=print,
        worsen=lambda *_: False,
    )

    def gains(current: Any) -> dict[str, float]:
        fits = further.get(tuple(current.explanation.effects), [])
        return {h.name: h.evidence - current.evidence for h in fits}

    asked._leaders = SimpleNamespace(fitted=fitted, take=lambda *_: None, gains=gains)
    asked._one_step = {}
    asked._tested = lambda *_: SimpleNamespace(p_value=0.0)
    asked._settled = lambda h: h
    asked._takes_up = asked._plainer = lambda *_: False
    asked.fits = lambda: SimpleNamespace(told=lambda e: diverging(e), closer=lambda h: h)
    asked.about = lambda *_: None
    asked.predicted, asked.in_closed_loop, asked.say = lambda _: None, False, lambda _: None
    asked.averaged_with, asked._refits, asked.pool = [], {}, SERIAL

    def averaged(_: Any, current: Any, rivals: Any) -> Any:
        asked.averaged_with.append([h.explanation.effects for h in rivals])
        return current.explanation

    monkeypatch.setattr(module, "averaged", averaged)
    monkeypatch.setattr(module, "moved_by_unnamed", lambda *_: Moved((), np.zeros(1)))
    monkeypatch.setattr(module, "no_longer_needed", lambda *_: None)
    monkeypatch.setattr(module, "costs_little", lambda *_: None)
    monkeypatch.setattr(module, "as_good_in_place", lambda *_: None)
    monkeypatch.setattr(module, "that_leads_instead", lambda *_: None)
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good[:1])
    monkeypatch.setattr(module, "in_newtons", lambda law, _: law)
    monkeypatch.setattr(name_after_name, "parameters_of", lambda model, chosen: chosen)
    monkeypatch.setattr(name_after_name, "explains_an_axis", lambda after, _: after.name == "payload")
    return asked, rounds


def diverging(explanation: Any) -> Any:
    if explanation.effects == ("waves",):
        raise np.linalg.LinAlgError("SVD did not converge")
    return explanation
