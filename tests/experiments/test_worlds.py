"""The study of other people's worlds: the rows that are kept give the figures that are told."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from auvnn.studies.benchmark.case import Case
from auvnn.studies.benchmark.cases import cases
from auvnn.studies.benchmark.counts import worlds
from auvnn.studies.benchmark.counts.rates import Z95, z_of
from tests.studies.benchmark.plans import of_plan

HERE = Path(__file__).resolve().parents[2] / "experiments" / "worlds"


# Samples that were run, and where each of them began: so far the plan was drawn twice, each drawing has 31 of them.
SAMPLES = {
    "rows.jsonl" if k == 0 else f"rows-{k + 1}.jsonl": (k % 31, 100000000 * (k // 31)) for k in range(44)
}


# Logs of the plan on which rules are made, with seeds that no rule has seen.
MADE, MADE_LATER = "rows-made.jsonl", "rows-made-49.jsonl"


def rows_of(name):
    return [json.loads(line) for line in (HERE / name).read_text().splitlines()]


@pytest.mark.parametrize("name", SAMPLES)
def test_the_rows_are_logs_of_the_plan(name):
    rows = rows_of(name)
    options, _ = of_plan("worlds")
    offset, shift = SAMPLES[name]
    sample = cases({**options, "every": 31, "offset": offset, "shift": shift})
    done = [Case.of_row(r) for r in rows]
    assert {*done} <= {*sample} and len({*done}) == len(rows)


def test_the_fresh_rows_are_logs_of_the_plan_on_which_rules_are_made():
    options, _ = of_plan("worlds_made")
    parts = ["disturbed", "disturbed_nothing", "shaped"]
    fresh = cases({**options, "shift": 14000000, "only": parts})
    done = [Case.of_row(r) for r in rows_of(MADE)]
    assert {*done} <= {*fresh} and len({*done}) == len(done)
    assert {c for c in fresh if c.part.startswith("disturbed")} <= {*done}, "of disturbed all are kept"
    of_shaped = [c for c in fresh if c.part == "shaped"]
    assert {c for c in done if c.part == "shaped"} == {*of_shaped[:20]}, (
        "of shaped the first ones, none picked"
    )


def test_the_fresh_logs_of_each_world_give_what_is_told():
    text = (HERE / "history.md").read_text()
    for world, said in (("disturbed", ("20 of 21", "1 of 39")), ("shaped", ("9 of 17", "2 of 20"))):
        rows = [r for r in rows_of(MADE) if r["part"] in (world, f"{world}_nothing")]
        seen = [r for r in rows if r["kind"] == "effect" and worlds.visible(r)]
        named = f"{sum(map(worlds.right, seen))} of {len(seen)}"
        wrong = f"{sum(map(worlds.wrong_first, rows))} of {len(rows)}"
        assert (named, wrong) == said and f"{named} (" in text and f"{wrong} logs" in text


def test_the_later_fresh_rows_are_every_seventh_log_of_that_plan():
    options, _ = of_plan("worlds_made")
    fresh = cases({**options, "shift": 49000000, "every": 7, "offset": 2})
    done = [Case.of_row(r) for r in rows_of(MADE_LATER)]
    assert {*done} == {*fresh} and len({*done}) == len(done)


@pytest.mark.parametrize("name", [*SAMPLES, MADE, MADE_LATER])
def test_the_rows_give_what_is_told(name):
    rows = rows_of(name)
    expected = json.loads((HERE / "expected.json").read_text())[name]
    seen = [r for r in rows if r["kind"] == "effect" and worlds.visible(r)]
    nothing = [r for r in rows if r["kind"] == "nothing"]
    disturbed = [r for r in rows if r["world"].startswith("disturbed")]
    found = {
        "logs": len(rows),
        "visible": len(seen),
        "visible_named_or_tied": sum(map(worlds.right, seen)),
        "visible_alone": sum(map(worlds.alone, seen)),
        "wrong_first": sum(map(worlds.wrong_first, rows)),
        "nothing": len(nothing),
        "nothing_without_a_name": sum(map(worlds.silent, nothing)),
        "nothing_adequate": sum(map(worlds.adequate, nothing)),
        "faults": sum(r["verdict"] == "fault" or bool(r["fault"]) for r in rows),
        "forces": sum(len(worlds.force_right(r)) for r in disturbed),
        "forces_right": sum(sum(worlds.force_right(r)) for r in disturbed),
        "intervals": sum(len(z_of(r)) for r in rows),
        "intervals_right": sum(abs(z) < Z95 for r in rows for z in z_of(r)),
    }
    assert found == expected
    text = "".join((HERE / n).read_text() for n in ("README.md", "history.md"))
    for words in (
        f"{found['visible_named_or_tied']} of {found['visible']} visible",
        f"{found['wrong_first']} of {found['logs']} logs",
    ):
        assert words in text


def test_the_tables_are_those_of_the_rows():
    spec = importlib.util.spec_from_file_location("samples", HERE / "samples.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert list(module.samples()) == list(range(1, len(SAMPLES) + 1))
    text = (HERE / "README.md").read_text().splitlines()
    for lines in (module.table(), module.table(3)):
        begin = text.index(lines[0])
        assert text[begin : begin + len(lines)] == lines
    right, of = module.forces(module.SINCE)
    assert f"{right} of {of} degrees of freedom" in " ".join(text)
