"""The study of effects that a model has: which cases it takes, what it counts, and that its figures are its rows."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[2] / "experiments" / "stated_effects"


@pytest.fixture(scope="module")
def run():
    sys.path.insert(0, str(HERE))
    try:
        import run

        yield run
    finally:
        sys.path.remove(str(HERE))
        sys.modules.pop("run", None)
        sys.modules.pop("second_day", None)


@pytest.fixture(scope="module")
def second_day(run):
    import second_day

    return second_day


def test_only_effects_whose_values_can_change_are_taken(run):
    from auvnn.effects import EFFECTS

    cases = run.chosen(1, 0, 45_000_000)
    names = {c.hidden for c in cases}
    assert {c.world.partition("_")[0] for c in cases} == {*run.WORLDS}
    assert {"ocean_current", "fin_offset"} <= names and not names & {
        "payload",
        "waves",
        "added_mass",
        "nothing",
    }
    assert names <= {*EFFECTS.names()}
    assert [c.seed for c in run.chosen(16, 8, 45_000_000)] == [c.seed for c in cases[8::16]]
    assert not {c.seed for c in cases} & {c.seed for c in run.chosen(1, 0, 47_000_000)}


def test_names_that_are_true_in_the_world_do_not_count(run):
    said = {"groups": [["tilted_vertical"], ["a", "b"], ["c"]], "true": ["tilted_vertical", "b", "a"]}
    row = {"effect": "a", "changed": said}
    # The effect's own name counts even where it is true by itself.
    assert run.others(row, "changed") == [["a"], ["c"]]


def row(changed, same, effect="a"):
    made = {"effect": effect}
    for day, groups in (("changed", changed), ("the same", same)):
        made[day] = {"groups": groups, "true": ["t"]}
    return made


def test_counts_are_of_first_names_and_of_any_name(run):
    rows = [
        row([["a", "b"], ["c"]], []),
        row([["t"], ["c"], ["a"]], [["t"]]),
        row([], [["c"], ["a"]]),
    ]
    assert run.counts(rows) == [
        "changed: named first or in the first group 1 of 3; another name first 1",
        "the same: no name 2 of 3; the effect itself 1",
    ]


def test_the_readme_says_what_the_rows_say(run):
    rows = [json.loads(x) for x in (HERE / "rows.jsonl").read_text().splitlines()]
    text = (HERE / "README.md").read_text()
    assert len({r["seed"] for r in rows}) == len(rows) == 19
    for line in run.counts(rows):
        assert line in text
    seeds = {c.seed for offset in (0, 8) for c in run.chosen(16, offset, 45_000_000)}
    assert {r["seed"] for r in rows} == seeds


def test_days_are_counted_by_world_and_in_all(second_day):
    day = {"accepted": True, "as given": 1.0, "noise floor": 0.1}
    rows = [
        {**day, "world": "between", "with it": 0.2, "regression": 0.5},
        {**day, "world": "shaped", "with it": 0.6, "regression": 0.5, "accepted": False},
        {**day, "world": "shaped", "with it": 0.4, "regression": 0.5},
    ]
    between, shaped, whole = second_day.counts(rows)
    assert between.startswith("between: accepted 1 of 1, better than the regression 1;")
    assert shaped.startswith("shaped: accepted 1 of 2, better than the regression 1;")
    assert (
        whole.startswith("all: accepted 2 of 3, better than the regression 2;") and "with it 0.400" in whole
    )


def test_the_readme_says_what_the_second_days_say(second_day):
    text = (HERE / "README.md").read_text()
    for name in ("days.jsonl", "days-before.jsonl", "improved.jsonl"):
        rows = [json.loads(x) for x in (HERE / name).read_text().splitlines()]
        assert len({r["seed"] for r in rows}) == len(rows) > 0
        whole = second_day.counts(rows)[-1]
        found = re.search(r"accepted (\d+) of (\d+), better than the regression (\d+)", whole)
        assert found is not None and found[0] in text


def test_the_readme_says_what_the_whole_loop_says(second_day):
    rows = [json.loads(x) for x in (HERE / "improved.jsonl").read_text().splitlines()]
    text = (HERE / "README.md").read_text()
    assert all(line in text for line in second_day.counts(rows))
    assert {r["seed"] for r in rows} == {
        json.loads(x)["seed"] for x in (HERE / "days.jsonl").read_text().splitlines()
    }
    found = sum(r["effect"] in r["steps"] for r in rows)
    assert f"is among the steps in {found} of {len(rows)}" in text
