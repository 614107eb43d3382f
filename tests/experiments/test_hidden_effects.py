"""The script of the hidden-effect experiment: its tables say what the answer says, its README can be filled."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

from auvnn.studies.benchmark import summarise
from auvnn.studies.benchmark.counts import counting
from auvnn.studies.benchmark.counts.rates import Z95, z_of

HERE = Path(__file__).resolve().parents[2] / "experiments" / "hidden_effects"


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location("hidden_effects_run", HERE / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def answer() -> dict[str, Any]:
    def row(size: str, verdict: str, missing: list[str]) -> dict[str, Any]:
        return {
            "vehicle": "rov95", "hidden": "cg_offset", "size": size, "noise": "realistic", "excitation": "multisine",
            "kind": "effect", "part": "one", "verdict": verdict, "missing": missing, "errors": {}, "seconds": 1.0,
            "fault": None, "fall": {"share": 0.93 if missing else 0.0},
        }  # fmt: skip

    rows = [row(s, "named", ["cg_offset"]) for s in ("medium", "large", "large")] + [
        row("small", "adequate", [])
    ]
    part = {"targets": [{"rate": "named_first", "least": 0.9, "sizes": ["medium", "large"]}]}
    plan = {"parts": {"one": part}, "targets": [{"rate": "median_fall", "least": 0.95}]}
    return json.loads(json.dumps(summarise(rows, {"plan": plan}).to_dict()))


def test_the_tables_say_what_the_answer_says(script, answer):
    text = script.tables(answer)
    assert "4 logs, 0 faults." in text
    assert "| one | named_first | at least 90 % | 100.0 % (43.9 to 100.0) | 3 | met |" in text
    assert "| all | median_fall | at least 95 % | 93.0 % | 4 | **missed** |" in text
    (line,) = [words for words in text.splitlines() if words.startswith("| `cg_offset`")]
    assert line.startswith("| `cg_offset` | 4 | 75.0 % (30.1 to 95.4) | 75.0 %") and line.endswith("| 93 % |")
    assert "too few logs or sizes" in line


def test_the_readme_is_filled_between_its_marks_and_can_be_filled_again(script, answer, tmp_path):
    readme = tmp_path / "README.md"
    text = (HERE / "README.md").read_text(encoding="utf-8")
    assert text.count(script.BEGIN) == text.count(script.END) == 1 and text.index(script.BEGIN) < text.index(
        script.END
    )
    readme.write_text(text, encoding="utf-8")
    (tmp_path / "out" / "figures").mkdir(parents=True)
    (tmp_path / "out" / "figures" / "confusion.png").write_bytes(b"png")
    script.into_readme(script.tables(answer), tmp_path / "out", readme)
    once = readme.read_text(encoding="utf-8")
    script.into_readme(script.tables(answer), tmp_path / "out", readme)
    assert readme.read_text(encoding="utf-8") == once
    assert once.startswith(text[: text.index(script.BEGIN)]) and once.endswith(text[text.index(script.END) :])
    assert "| `cg_offset` | 4 |" in once and "(figures/confusion.png)" in once
    assert (tmp_path / "figures" / "confusion.png").read_bytes() == b"png"


def rows_of(name):
    return [json.loads(line) for line in (HERE / name).read_text().splitlines()]


def test_fresh_logs_of_nothing_are_as_the_text_says():
    rows = rows_of("rows-nothing.jsonl")
    adequate = sum(r["verdict"] == "adequate" for r in rows)
    assert len({r["seed"] for r in rows}) == len(rows) == 200
    assert sum(bool(r["missing"]) for r in rows) == 200 - adequate
    assert f"{adequate} of 200 adequate" in (HERE / "README.md").read_text()


def test_fresh_pairs_and_strangers_are_as_the_text_says():
    rows, text = rows_of("rows-fresh.jsonl"), (HERE / "README.md").read_text()
    pairs = [r for r in rows if r["part"] == "pairs"]
    strangers = [r for r in rows if r["part"] == "strangers"]
    assert len({(r["seed"], r["hidden"], r["size"]) for r in rows}) == len(rows) == 88
    shown, both = (sum(count(r) for r in pairs) for count in (counting.all_shown_named, counting.all_named))
    assert f"is named in {shown} of {len(pairs)} " in text and f"both names in {both}, no false name" in text
    assert not any(counting.false_names(r) for r in pairs)
    unknown = [r for r in strangers if r["verdict"] == "unknown"]
    assert f"the strangers {len(unknown)} of {len(strangers)} are `unknown`" in text
    assert all(r["missing"] == ["cg_offset"] for r in strangers if r["verdict"] != "unknown")


def test_strangers_run_once_more_are_as_the_text_says():
    rows, text = rows_of("rows-strangers.jsonl"), (HERE / "README.md").read_text()
    assert len({(r["seed"], r["hidden"], r["size"]) for r in rows}) == len(rows) == 48
    right = [r for r in rows if r["verdict"] in ("unknown", "partial") and not r["missing"]]
    assert f"{len(right)} of {len(rows)} are `unknown` or `partial`" in text
    assert all(r["axis"] in r["axes_true"] for r in right)
    wrong = [r for r in rows if r["missing"]]
    assert [r["missing"] for r in wrong] == [["cg_offset"]] * 5
    assert {r["size"] for r in wrong} == {"medium"}
    kinds = sorted(r["hidden"] for r in wrong)
    assert kinds == ["stranger_loose_mass"] * 3 + ["stranger_turn_roll"] * 2
    assert sum(r["verdict"] == "adequate" for r in rows) == 2


def test_strangers_with_further_seeds_are_as_the_text_says():
    rows, text = rows_of("rows-strangers-2.jsonl"), (HERE / "README.md").read_text()
    assert len({(r["seed"], r["hidden"], r["size"]) for r in rows}) == len(rows) == 48
    assert not {r["seed"] for r in rows} & {r["seed"] for r in rows_of("rows-strangers.jsonl")}
    right = [r for r in rows if r["verdict"] == "unknown" and not r["missing"]]
    assert f"{len(right)} of {len(rows)} are `unknown` without a name" in text
    assert all(r["axis"] in r["axes_true"] for r in right)
    wrong = [(r["hidden"], r["size"], *r["missing"]) for r in rows if r["missing"]]
    assert sorted(wrong) == [
        *[("stranger_loose_mass", "medium", "cg_offset")] * 3,
        ("stranger_turn_roll", "large", "constant_force"),
        *[("stranger_turn_roll", "medium", "cg_offset")] * 3,
    ]
    nothing = [r for r in rows if r["verdict"] == "adequate"]
    assert len(nothing) == 2 and all(r["p_value"] == 1.0 and r["size"] == "medium" for r in nothing)


def test_what_an_oracle_sees_of_strangers_is_as_the_text_says():
    rows, text = rows_of("rows-strangers-3.jsonl"), (HERE / "README.md").read_text()
    assert len({(r["seed"], r["hidden"], r["size"]) for r in rows}) == len(rows) == 48
    assert not {r["seed"] for r in rows} & {r["seed"] for r in rows_of("rows-strangers-2.jsonl")}
    right = [r for r in rows if r["verdict"] in ("unknown", "partial") and not r["missing"]]
    there = sum(r["axis"] in r["axes_true"] for r in right)
    assert f"{len(right)} of {len(rows)} are `unknown` or `partial` without a name (85 %" in text
    assert f"{there} of them in the right degree of freedom (83 %" in text
    wrong = [r for r in rows if r["missing"]]
    assert [r["missing"] for r in wrong] == [["cg_offset"]] * 4 and {r["size"] for r in wrong} == {"medium"}
    kinds = sorted(r["hidden"] for r in wrong)
    assert kinds == ["stranger_loose_mass"] * 3 + ["stranger_turn_roll"]
    adequate = sorted(r["hidden"] for r in rows if r["verdict"] == "adequate")
    assert adequate == ["stranger_pitch_thrust"] * 2 + ["stranger_square_wave"]
    seen = [r["oracle_distances"][r["hidden"]] for r in rows]
    medium = [d["nothing"] for r, d in zip(rows, seen, strict=True) if r["size"] == "medium"]
    assert 13.0 <= min(medium) < 13.5
    told = [r["oracle_distances"][r["hidden"]]["cg_offset"] for r in wrong]
    assert f"by {min(told):.1f} to {max(told):.1f} of them" in text


def test_logs_run_again_have_the_answers_that_the_text_says():
    def key(row):
        return tuple(row[k] for k in ("part", "hidden", "size", "seed", "vehicle"))

    def answer(row):
        return row["verdict"], row["missing"]

    before = {key(r): answer(r) for r in rows_of("rows.jsonl")}
    for name in ("rows-paired.jsonl", "rows-sample-4.jsonl"):
        again = [r for r in rows_of(name) if key(r) in before]
        same = sum(answer(r) == before[key(r)] for r in again)
        assert f"{same} of {len(again)} have the answer" in (HERE / "README.md").read_text()
    last = [z for r in rows_of("rows-sample-4.jsonl") for z in z_of(r)]
    told = f"{sum(abs(z) < Z95 for z in last)} of {len(last)} intervals right; 19 s in the median"
    assert told in (HERE / "README.md").read_text()
