"""A plainer cause that explains nearly all of what a name does, where the model is known to be wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import search
from auvnn.diagnosis.noise_law.rounds import beside_all_names as module
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.rounds.plainer_causes import nearly_all, nearly_in_place, plainer_rivals
from tests.diagnosis.noise_law.scripted import found, scripted
from tests.diagnosis.noise_law.stand_ins import explanation, fit, one_by_one, worth
from tests.diagnosis.noise_law.test_from_names import begun


@pytest.mark.parametrize(
    ("short", "without", "rest", "expected"),
    [
        # A hundredth of ten thousand is a hundred.
        (64.0, -10_000.0, 14.0, True),
        (99.0, -10_000.0, 14.0, True),
        (101.0, -10_000.0, 14.0, False),
        (64.0, -5_000.0, 14.0, False),
        # Nothing says that the model is wrong: the odds hold as they are.
        (64.0, -10_000.0, 4.0, False),
        (64.0, None, 14.0, False),
    ],
)
def test_a_plainer_cause_may_fall_short_by_a_hundredth(short, without, rest, expected):
    neither = None if without is None else worth(without)
    assert nearly_all(worth(0.0), worth(-short), neither, rest) is expected


RIVALS: Any = {
    "constant_force": [explanation(n) for n in ("net_buoyancy", "ocean_current", "cg_offset")],
    "tether": [explanation("constant_force"), explanation("compressibility")],
}
NAMES = fit(0.0, "tether", "constant_force")


def test_only_plainer_causes_that_are_not_named_are_asked_for():
    changes = plainer_rivals(["constant_force", "tether", "waves"], NAMES, RIVALS)
    assert [(name, e.effects[-1]) for name, e in changes if e is not None] == [
        ("constant_force", "net_buoyancy"),
        ("constant_force", "cg_offset"),
        ("tether", "compressibility"),
    ]


def test_the_best_plainer_cause_that_explains_nearly_all_is_found():
    asked: list[Any] = []

    def refit(changes: Any) -> Any:
        asked.append([(name, rival and rival.effects[-1]) for name, rival in changes])
        gains = {None: -10_000.0, "net_buoyancy": -64.0, "cg_offset": -900.0, "compressibility": -80.0}
        return [fit(gains[rival and rival.effects[-1]], "any") for _, rival in changes]

    changes = plainer_rivals(["constant_force", "tether"], NAMES, RIVALS)
    name, other = nearly_in_place(changes, NAMES, refit, 14.0)  # type: ignore[misc]
    assert (name, other.evidence) == ("constant_force", -64.0)
    assert asked[0] == [
        ("constant_force", "net_buoyancy"),
        ("constant_force", "cg_offset"),
        ("tether", "compressibility"),
    ]
    # What each name explains is asked of the fit without it.
    assert asked[1:] == [[("constant_force", None)]] * 2 + [[("tether", None)]]
    assert nearly_in_place(changes[1:2], NAMES, refit, 14.0) is None
    # A cause that cannot be fitted in the place of a name is no rival.
    assert nearly_in_place(changes, NAMES, lambda of: [None if e else NAMES for _, e in of], 14.0) is None
    asked.clear()
    assert nearly_in_place(changes, NAMES, refit, 4.0) is None and not asked


@pytest.mark.parametrize(
    ("lead", "rest", "without", "stays"),
    [
        ("net_buoyancy", 14.0, -10_000.0, True),
        # A rival that is no plainer has no such claim, nor one where the model is not known to be wrong.
        ("ocean_current", 14.0, -10_000.0, False),
        ("net_buoyancy", 4.0, -10_000.0, False),
        ("net_buoyancy", 14.0, -5_000.0, False),
    ],
)
def test_a_plainer_cause_that_leads_stays_in_the_lead(monkeypatch, lead, rest, without, stays):
    monkeypatch.setattr(module, "predicts_better", lambda *_, **__: True)
    layout: Any = SimpleNamespace(columns={lead: range(1), "constant_force": range(6)})
    groups: Any = [[explanation(lead), explanation("constant_force")]]

    def of(name: str, rival: Any) -> Any:
        given = fit(without, name) if rival is None else fit(64.0, name, "constant_force")
        return SimpleNamespace(**vars(given), misfit=-2.0 * given.evidence)

    current: Any = SimpleNamespace(evidence=0.0, misfit=0.0)
    told = module.that_leads_instead(layout, groups, current, one_by_one(of), rest)
    assert (told is None) is stays


@pytest.mark.parametrize(("rest", "order"), [(14.0, ["net_buoyancy", "constant_force"]), (4.0, None)])
def test_a_search_tells_the_plainer_cause_first_and_the_name_with_it(monkeypatch, rest, order):
    asked, before, _ = begun(monkeypatch)
    del asked._plainer
    before.steps = [{"verdict": "named", "effects": ["constant_force"], "p_value": 0.01}]
    asked.rest = lambda _: rest
    rival = SimpleNamespace(effects=("net_buoyancy",))
    monkeypatch.setattr(search, "rivals_tried", lambda *_: {"constant_force": [rival]})
    fits = {None: found(-10_000.0), "net_buoyancy": found(36.0, "net_buoyancy")}
    finished: list[bool] = []

    def refitted(*given: Any, whole: bool) -> Any:
        finished.append(whole)
        return fits[given[5] and given[5].effects[-1]]

    monkeypatch.setattr(search, "refitted", refitted)
    path = asked.changed(found(100.0, "constant_force"), before)
    assert (path and [(s["verdict"], s["effects"]) for s in path.steps]) == (order and [("ambiguous", order)])
    # Fits that fall far short are finished where shares are asked for.
    assert all(finished) and len(finished) == (2 if order else 0)
    if path is not None:
        assert path.dropped == ["constant_force"] and path.current.name == "net_buoyancy"


@pytest.mark.parametrize(
    ("short", "order"), [(8.0, ["net_buoyancy", "tether"]), (12.0, ["tether", "net_buoyancy"])]
)
def test_a_plainer_cause_in_a_group_leads_it_at_the_end(monkeypatch, short, order):
    """Though the one that led is ahead by the odds that a name needs."""
    further = {
        (): [found(10.0, "tether"), found(9.0, "net_buoyancy")],
        ("tether",): [],
        ("net_buoyancy",): [],
    }
    asked, _ = scripted(monkeypatch, further)
    del asked._plainer
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good)
    monkeypatch.setattr(name_after_name, "decided", lambda good, *_: good)
    monkeypatch.setattr(search, "those_that_lose", lambda *_: set())
    asked.rest = lambda _: 14.0
    fits = {None: found(-990.0), "net_buoyancy": found(10.0 - short, "net_buoyancy")}
    monkeypatch.setattr(search, "refitted", lambda *given, whole: fits[given[5] and given[5].effects[-1]])
    ended = asked.run(found(-1000.0), [], 1)
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [("ambiguous", order)]
    assert [[e.effects[-1] for e in g] for g in ended.groups] == [order]
    assert ended.last.effects[-1] == order[0]
