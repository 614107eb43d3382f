"""Rivals with fewer parameters: they lose by no less than what is still unexplained."""

from __future__ import annotations

from typing import Any

import pytest

from auvnn.diagnosis.noise_law import search as module
from auvnn.diagnosis.noise_law.rounds.path import Path
from tests.diagnosis.noise_law.scripted import found, names, scripted


@pytest.mark.parametrize(
    ("worth", "promised", "gained", "expected"),
    [
        # A tenth of the gain would be 10: one mass in the place of twelve numbers falls short by less than what is left.
        ({"trapped_water": 75.0}, 30.0, (), ["trapped_water", "payload"]),
        (
            {"trapped_water": 75.0, "net_buoyancy": 85.0},
            30.0,
            (),
            ["net_buoyancy", "trapped_water", "payload"],
        ),
        (
            {"trapped_water": 75.0, "net_buoyancy": 85.0, "cg_offset": 80.0},
            30.0,
            (),
            ["net_buoyancy", "cg_offset", "payload"],
        ),
        ({"trapped_water": 65.0}, 30.0, (), ["payload"]),
        # What a further effect gained once it was fitted counts, too, where its test promised less.
        ({"trapped_water": 65.0}, 30.0, (36.0, 2.0), ["trapped_water", "payload"]),
        ({"trapped_water": 65.0}, 30.0, (34.0,), ["payload"]),
        # Half of the gain is asked for, however much is left.
        ({"trapped_water": 55.0}, 60.0, (), ["trapped_water", "payload"]),
        ({"trapped_water": 45.0}, 60.0, (), ["payload"]),
        # What is not known to be confused with it, or has as many parameters, is judged as before.
        ({"waves": 95.0}, 30.0, (), ["payload"]),
        ({"flooding": 95.0}, 30.0, (), ["payload"]),
    ],
)
def test_what_has_fewer_parameters_loses_by_no_less_than_what_is_still_unexplained(
    monkeypatch, worth, promised, gained, expected
):
    beside = ("tether", "payload")
    asked, _ = scripted(monkeypatch, {beside: [found(100.0 + e, *beside, "gyro_bias") for e in gained]})
    asked.layout.columns.update({"payload": range(12), "flooding": range(12)})
    asked_at: list[Any] = []

    def what_is_left(path: Any) -> float:
        asked_at.append((path.current.name, path.chosen))
        return promised

    asked.rest = what_is_left
    path = Path(found(0.0, "tether"), ["tether"])
    good = sorted(
        [found(100.0, "payload"), *(found(e, n) for n, e in worth.items())], key=lambda h: -h.evidence
    )
    assert names(asked._with_simpler(good[:1], good, path, found(-1000.0))) == expected
    assert all(at == ("payload", ["tether", "payload"]) for at in asked_at)
    # Where nothing simpler could join nothing is asked.
    asked_at.clear()
    assert len(asked._with_simpler(good[:1] * 3, good, path, found(-1000.0))) == 3 and not asked_at


def test_what_has_fewer_parameters_leads_the_step_that_it_is_told_in(monkeypatch):
    further = {
        (): [found(-100.0, "payload"), found(-140.0, "trapped_water")],
        ("payload",): [found(-50.0, "payload", "waves")],
        ("trapped_water",): [],
    }
    asked, _ = scripted(monkeypatch, further, 0)
    asked.layout.columns["payload"] = range(12)
    asked.rest = lambda _: 0.0
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    ended = asked.run(found(-1000.0), [], 4)
    assert [s["effects"] for s in ended.steps] == [["trapped_water", "payload"]]
    assert ended.last.effects == ("trapped_water",)
