"""The study of vehicles without a DVL: the rows that are kept give the figures that are told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from auvnn.config import read_yaml

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "experiments" / "no_dvl"
# What passes for a net buoyancy at an unchanging depth; the other effects have no such double on these logs.
TIES = {"net_buoyancy": {"net_buoyancy", "compressibility"}}


def rows_of(name):
    rows = [json.loads(line) for line in (HERE / name).read_text().splitlines()]
    assert not any(r["fault"] for r in rows)
    assert all(r["without"] == ["u", "v", "w", "x", "y"] and r["made"] for r in rows)
    return rows


def counted(rows):
    """Return how many of each effect are named or rightly tied, and how many logs of nothing are adequate."""
    hits = {}
    for r in rows:
        if r["hidden"] != "nothing":
            right = r["hidden"] in r["missing"]
            right = right and set(r["missing"]) <= TIES.get(r["hidden"], {r["hidden"]})
            hits[r["hidden"]] = hits.get(r["hidden"], 0) + right
    adequate = sum(r["verdict"] == "adequate" for r in rows if r["hidden"] == "nothing")
    return {"named_or_tied": hits, "adequate_with_nothing": adequate}


def test_the_fresh_sample_is_whole_and_of_one_version():
    rows = rows_of("rows.jsonl")
    plan = read_yaml(ROOT / "configs" / "plan" / "no_dvl.yaml")["parts"]
    for part, asked in plan.items():
        own = [r for r in rows if r["part"] == part]
        kinds = {r["hidden"] for r in own}
        assert len(own) == asked["repeats"] * len(kinds) == len({(r["hidden"], r["seed"]) for r in own})
    assert len(rows) == 60 and len({r["code"] for r in rows}) == 1


@pytest.mark.parametrize("name", ["rows.jsonl", "rows-first.jsonl"])
def test_the_rows_give_what_is_told(name):
    expected = json.loads((HERE / "expected.json").read_text())[name]
    assert counted(rows_of(name)) == {k: expected[k] for k in ("named_or_tied", "adequate_with_nothing")}
    without = expected.get("without_rows", {})
    right = sum(expected["named_or_tied"].values()) + without.get("named_or_tied", 0)
    assert f"{right} of 40" in (HERE / "README.md").read_text()
    assert expected["adequate_with_nothing"] + without.get("adequate_with_nothing", 0) == 20
