"""The sixty logs: those that are committed are those that are drawn, and shares are what they say."""

from __future__ import annotations

import importlib.util
import json
from collections import Counter
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[2] / "experiments" / "improve"


@pytest.fixture(scope="module")
def sixty():
    spec = importlib.util.spec_from_file_location("sixty", HERE / "sixty.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_twenty_of_each_cost_with_seeds_of_their_own():
    rows = json.loads((HERE / "sixty.json").read_text())
    assert Counter(r["size"] for r in rows) == {"15%": 20, "40%": 20, "150%": 20}
    assert len({r["seed"] for r in rows}) == 60 == len(rows)
    assert max(Counter((r["hidden"], r["size"]) for r in rows).values()) == 1


def test_a_share_is_of_the_truths_fall_and_none_of_no_fall(sixty):
    errors = {"given": 1.0, "refitted": 0.8, "found": 0.45, "true": 0.4}
    assert sixty.share(errors, "given") == pytest.approx(0.55 / 0.6)
    assert sixty.share(errors, "refitted") == pytest.approx(0.35 / 0.4)
    assert sixty.share({**errors, "given": 0.401}, "given") is None


def test_targets_are_of_the_median_and_of_nine_in_ten(sixty):
    rows = [{"size": "40%", "share": s} for s in (0.95,) * 8 + (0.7,) * 2]
    found = sixty.judged(rows)["share"]
    assert found["median"] == pytest.approx(0.95) and found["reach_three_quarters"] == pytest.approx(0.8)
    assert not found["met"] and sixty.judged([*rows[:8], *rows[:2]])["share"]["met"]
    assert sixty.judged([{"size": "15%", "share": None, "fault": "x"}])["faults"] == 1


def test_the_rows_that_are_kept_are_the_logs_that_were_drawn_and_give_what_is_told(sixty):
    rows = [json.loads(line) for line in (HERE / "rows.jsonl").read_text().splitlines()]
    drawn = json.loads((HERE / "sixty.json").read_text())
    assert [{k: r[k] for k in ("hidden", "size", "seed")} for r in rows] == drawn
    for r in rows:
        assert r["share"] == pytest.approx(sixty.share(r["errors"], "given"))
    found = sixty.judged(rows)
    assert found["faults"] == 0 and found["share"]["met"] and found["share_from_refitted"]["met"]
    text = (HERE / "README.md").read_text()
    for key in ("share", "share_from_refitted"):
        count = found[key]["logs"]
        assert f"{round(found[key]['reach_three_quarters'] * count)} of {count}" in text
        assert f"{found[key]['median']:.3f}" in text
