"""Rivals with fewer parameters: they lose by no less than what is still unexplained."""

from __future__ import annotations

from types import SimpleNamespace
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
        # What it did not gain does not count, whatever its test promised.
        ({"trapped_water": 65.0}, 36.0, (), ["trapped_water", "payload"]),
        ({"trapped_water": 65.0}, 36.0, (2.0, 34.0, 3.0), ["payload"]),
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
    others = ("gyro_bias", "ocean_current", "waves")
    fits = [found(100.0 + e, *beside, n) for e, n in zip(gained, others, strict=False)]
    asked, _ = scripted(monkeypatch, {beside: fits})
    asked.layout.columns.update({"payload": range(12), "flooding": range(12)})
    asked_at: list[Any] = []

    def tests(current: Any, remaining: Any, base: Any, chosen: Any) -> Any:
        asked_at.append((current.name, chosen))
        promises = dict.fromkeys(others, 0.0) | {"waves": promised}
        scores = {n: SimpleNamespace(evidence=e, degrees=1) for n, e in promises.items()}
        return SimpleNamespace(p_value=0.0, scores=scores)

    asked._tested = tests
    path = Path(found(0.0, "tether"), ["tether"])
    good = sorted(
        [found(100.0, *beside), *(found(e, "tether", n) for n, e in worth.items())], key=lambda h: -h.evidence
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
    promises = {"waves": SimpleNamespace(evidence=0.0, degrees=1)}
    asked._tested = lambda *_: SimpleNamespace(p_value=0.0, scores=promises)
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    ended = asked.run(found(-1000.0), [], 4)
    assert [s["effects"] for s in ended.steps] == [["trapped_water", "payload"]]
    assert ended.last.effects == ("trapped_water",)
