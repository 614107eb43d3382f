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
    rest, none = plan["rest"], plan["nothing_rest"]
    assert {r["hidden"] for r in rows} == {*rest["effects"], "nothing"} and not any(r["fault"] for r in rows)
    assert all(r["without"] == ["u", "v", "w", "x", "y"] and r["made"] for r in rows)
    hits = {}
    for name in rest["effects"]:
        own = [r for r in rows if r["hidden"] == name]
        assert len(own) == rest["repeats"]
        hits[name] = sum(name in r["missing"] and set(r["missing"]) <= TIES.get(name, {name}) for r in own)
    assert hits == expected["rest_by_effect"]
    adequate = sum(r["verdict"] == "adequate" for r in rows if r["hidden"] == "nothing")
    parts, whole = expected["parts"], expected["all"]
    assert sum(hits.values()) == parts["rest"]["named_or_tied"] and adequate == none["repeats"]
    assert whole["named_or_tied"][0] == sum(parts[p]["named_or_tied"] for p in ("first", "rest"))
    assert whole["adequate_with_nothing"][0] == parts["nothing_first"]["adequate"] + adequate
    text = (HERE / "README.md").read_text()
    assert f"{whole['named_or_tied'][0]} of {whole['named_or_tied'][1]} (" in text
