"""The study of vehicles without a DVL: the rows that are kept give the figures that are told."""

from __future__ import annotations

import json
from pathlib import Path

from auvnn.config import read_yaml

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "experiments" / "no_dvl"
# What passes for a net buoyancy at an unchanging depth; the other effects have no such double on these logs.
TIES = {"net_buoyancy": {"net_buoyancy", "compressibility"}}


def test_the_rows_give_what_is_told():
    rows = [json.loads(line) for line in (HERE / "rows.jsonl").read_text().splitlines()]
    expected = json.loads((HERE / "expected.json").read_text())
    plan = read_yaml(ROOT / "configs" / "plan" / "no_dvl.yaml")["parts"]
    assert not any(r["fault"] for r in rows)
    assert all(r["without"] == ["u", "v", "w", "x", "y"] and r["made"] for r in rows)
    for part in ("first", "rest"):
        hits = {}
        for name in plan[part]["effects"]:
            own = [r for r in rows if r["hidden"] == name and r["part"] == part]
            if not own and name in expected["without_rows"][part]:
                continue
            assert len(own) == plan[part]["repeats"] == len({r["seed"] for r in own})
            hits[name] = sum(
                name in r["missing"] and set(r["missing"]) <= TIES.get(name, {name}) for r in own
            )
        assert hits == expected["by_effect"][part]
        told = sum(hits.values()) + sum(expected["without_rows"][part].values())
        assert told == expected["parts"][part]["named_or_tied"]
    none = {p: [r for r in rows if r["part"] == p] for p in ("nothing_first", "nothing_rest")}
    for part, own in none.items():
        assert len(own) in (0, plan[part]["repeats"])
        adequate = sum(r["verdict"] == "adequate" for r in own)
        assert expected["parts"][part]["adequate"] == (adequate if own else expected["without_rows"][part])
    whole, parts = expected["all"], expected["parts"]
    assert whole["named_or_tied"][0] == sum(parts[p]["named_or_tied"] for p in ("first", "rest"))
    assert whole["adequate_with_nothing"][0] == sum(parts[p]["adequate"] for p in none)
    text = (HERE / "README.md").read_text()
    assert f"{whole['named_or_tied'][0]} of {whole['named_or_tied'][1]} (" in text
