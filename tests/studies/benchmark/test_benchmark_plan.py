"""Plans, pairs, loops and strangers as cases; the shipped plans are what they say about themselves."""

from __future__ import annotations

import importlib.util
from collections import Counter
from typing import Any

import numpy as np
import pytest

from auvnn.config import config_dir, read_yaml
from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError
from auvnn.models import load
from auvnn.simulation import EXCITATIONS, make_excitation
from auvnn.studies.benchmark.cases import CLOSED, KEYS, Case, apart, cases, targets, together
from auvnn.studies.benchmark.counts.rates import NUMBERS, RATES
from auvnn.studies.benchmark.strangers import said_axis, stranger_names

OPTIONS: dict[str, Any] = {
    "effects": ["cg_offset", "net_buoyancy", "tether"], "sizes": ["medium", "large"], "noises": "realistic",
    "excitations": "multisine", "vehicles": "rov95", "coefficients": "exact", "repeats": 2, "seed": 10, "runs": 4,
    "duration": 60, "rate": 20, "workers": 1,
}  # fmt: skip


def plan(**parts: Any) -> dict[str, Any]:
    return {**OPTIONS, "plan": {"name": "p", "common": {"duration": 15.0}, "parts": parts}}


def test_a_plan_is_its_parts_one_after_the_other():
    found = cases(
        plan(one={"effects": "cg_offset", "sizes": "small"}, two={"effects": "nothing", "repeats": 3})
    )
    away = apart("cg_offset")
    assert [(c.part, c.hidden, c.size, c.seed) for c in found] == [
        ("one", "cg_offset", "small", 10 + away), ("one", "cg_offset", "small", 11 + away),
        ("two", "nothing", "none", 10), ("two", "nothing", "none", 11), ("two", "nothing", "none", 12),
    ]  # fmt: skip
    # What a part does not say is common to the plan, and then as asked for beside it.
    assert {(c.duration, c.runs) for c in found} == {(15.0, 4)}


def test_samples_of_a_plan_are_its_logs_each_in_one_of_them():
    parts = {
        "one": {"effects": ["cg_offset", "tether"], "repeats": 5},
        "two": {"effects": "nothing", "repeats": 9},
    }
    whole = cases(plan(**parts))
    samples = [cases({**plan(**parts), "every": 7, "offset": k}) for k in range(7)]
    assert sorted(map(repr, whole)) == sorted(repr(c) for sample in samples for c in sample)
    # Each part begins elsewhere; and what a part holds does not depend on which others are asked for.
    assert samples[0][0] == whole[0]
    (first_of_two,) = {c for c in cases({**plan(**parts), "every": 7, "only": "two"}) if c.seed < 18}
    assert first_of_two in samples[0]
    for wrong in ({"every": 0}, {"every": 3, "offset": 3}, {"every": 1.5}):
        with pytest.raises(ConfigError, match="every"):
            cases({**plan(**parts), **wrong})


def test_a_plan_can_be_asked_again_on_logs_that_nobody_has_seen():
    pairs = {"pairs": 12, "repeats": 0}
    options = plan(one={"effects": "cg_offset", "seed": 500}, two={"effects": "nothing"}, three=pairs)
    before, after = cases(options), cases({**options, "shift": 77})
    assert [c.seed for c in after] == [c.seed + 77 for c in before]
    assert [(c.part, c.kind, c.duration) for c in after] == [(c.part, c.kind, c.duration) for c in before]
    # What is hidden together is drawn again as well.
    drawn = [[c.hidden for c in found if c.kind == "several"] for found in (before, after)]
    assert len(drawn[0]) == len(drawn[1]) == 12 and drawn[0] != drawn[1]
    with pytest.raises(ConfigError, match="shift=-1"):
        cases({**options, "shift": -1})


def test_only_some_parts_are_run_where_only_some_are_wanted():
    options = plan(one={"targets": [{"rate": "named_first", "least": 1.0}]}, two={"effects": "nothing"})
    assert {c.part for c in cases({**options, "only": "two"})} == {"two"}
    assert targets({**options, "only": ["two"]}) == []
    assert targets(options) == [{"part": "one", "rate": "named_first", "least": 1.0}]
    with pytest.raises(ConfigError, match=r"'tow'.*'two'"):
        cases({**options, "only": ["tow"]})


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"parts": {"one": {"repeets": 3}}}, "repeats"),
        ({"prats": {}}, "parts"),
        ({"parts": {"one": {"loops": "opne"}}}, "open"),
        ({"parts": {"one": {"pairs": -1}}}, "whole number"),
        ({"parts": {"one": {"effects": ["tehter"]}}}, "tether"),
        ({"parts": {"one": {"candidates": ["tehter"]}}}, "tether"),
    ],
)
def test_what_a_plan_does_not_know_is_refused(wrong, words):
    with pytest.raises(ConfigError, match=words):
        cases({**OPTIONS, "plan": wrong})


def test_pairs_are_drawn_by_the_seed_and_are_not_all_the_same():
    options = {**OPTIONS, "repeats": 0, "pairs": 12, "triples": 1}
    found = cases(options)
    assert found == cases(options) and Counter(c.kind for c in found) == {"several": 13}
    pairs = [c for c in found if len(c.effects) == 2]
    assert len(pairs) == 12 and [c.seed for c in pairs] == list(range(10, 22))
    assert all(len({*c.effects}) == 2 and {*c.effects} <= {*OPTIONS["effects"]} for c in pairs)
    assert all(len(c.sizes) == 2 and {*c.sizes} <= {"medium", "large"} for c in pairs)
    assert len({frozenset(c.effects) for c in pairs}) == 3 and len({c.sizes for c in pairs}) > 2
    # Another number of pairs does not change those that were there before.
    assert cases({**options, "pairs": 3})[:3] == pairs[:3]


def test_what_excludes_one_another_is_never_hidden_together():
    excluding = {n: EFFECTS.get(n).excludes for n in EFFECTS.names()}
    for seed in range(300):
        drawn = together(list(excluding), ["large"], 3, seed)[0].split("+")
        assert not any(b in excluding[a] for a in drawn for b in drawn)
    with pytest.raises(ConfigError, match="hidden together"):
        together(["tether"], ["large"], 2, 0)


def test_loops_choose_among_the_manoeuvres():
    def manoeuvres(**more: Any) -> list[str]:
        return [
            c.excitation
            for c in cases({**OPTIONS, "effects": "tether", "sizes": "large", "repeats": 1, **more})
        ]

    assert manoeuvres(excitations=["multisine", "dives"], loops="closed") == ["dives"]
    assert manoeuvres(loops=["open", "closed"]) == ["multisine", "survey"]
    assert manoeuvres(excitations="survey", loops="open") == ["multisine"]
    assert [c.loop for c in cases({**OPTIONS, "effects": "tether", "excitations": "survey"})] == [
        "closed"
    ] * 4


def test_the_closed_manoeuvres_are_those_with_a_controller():
    model, t = load("rov95"), np.arange(201) / 20.0
    closed = []
    for name in EXCITATIONS.names():
        generators = [np.random.default_rng(0)]
        if make_excitation(name, EXCITATIONS).plan(model, t, generators).controller is not None:
            closed.append(name)
    assert set(closed) == set(CLOSED)


def test_a_case_comes_back_from_its_row():
    for case in cases({**OPTIONS, "pairs": 1, "candidates": ["tether"], "accelerations": [True, False]}):
        assert Case.of_row({**case.to_row(), "verdict": "named", "missing": []}) == case
    # Rows of older benchmarks say less.
    old = {k: getattr(case, k) for k in ("vehicle", "hidden", "size", "noise", "excitation", "coefficients", "seed",
                                         "runs", "duration", "rate")}  # fmt: skip
    assert Case.of_row(old).plant == "own" and Case.of_row(old).candidates is None


def test_without_strangers_none_are_needed():
    assert stranger_names([]) == []


def test_the_degree_of_freedom_said_is_the_one_that_is_explained_best():
    assert said_axis({"X": {"u": 0.1, "t": 0.05}, "N": {"r": 0.2}, "Z": {}}) == "N"
    assert said_axis({"X": {"u": 0.2, "t": 0.05}, "N": {"r": 0.2}}) == "X"
    assert said_axis({"X": {}, "Y": {}}) is None and said_axis({}) is None


@pytest.mark.parametrize("name", ["full", "reduced"])
def test_the_shipped_plans_aim_at_rates_that_there_are(name):
    shipped = read_yaml(config_dir() / "plan" / f"{name}.yaml")
    assert shipped["name"] == name
    aims = targets({"plan": shipped})
    assert aims and all(a["rate"] in {*RATES, *NUMBERS} for a in aims)
    assert all("least" in a or "most" in a for a in aims)
    assert {key for part in shipped["parts"].values() for key in part} <= {*KEYS, "targets"}


def test_the_reduced_plan_is_a_handful_of_short_logs():
    found = cases({**OPTIONS, "plan": read_yaml(config_dir() / "plan" / "reduced.yaml")})
    assert 4 <= len(found) <= 8 and sum(c.runs * c.duration for c in found) <= 200
    assert {c.kind for c in found} == {"effect", "several", "nothing"}
    assert {c.loop for c in found} == {"open", "closed"}


def test_the_full_plan_asks_for_all_that_was_promised():
    shipped = read_yaml(config_dir() / "plan" / "full.yaml")
    # Strangers and engines live in plants that need not be there.
    if importlib.util.find_spec("auvnn.plants") is None:
        for name in ("strangers", "engine", "engine_nothing"):
            shipped["parts"].pop(name)
        shipped["common"]["plants"] = "own"
    found = cases({**OPTIONS, "plan": shipped})
    assert len(found) >= 500 and len(set(found)) == len(found)
    assert {c.vehicle for c in found} == {"rov95", "bluerov2", "bluerov2_heavy", "remus100"}
    assert {c.noise for c in found} == {"none", "realistic"}
    assert {c.loop for c in found} == {"open", "closed"} and {c.accelerations for c in found} == {None, True}
    assert {len(c.effects) for c in found} == {0, 1, 2, 3}
    hidden = {c.hidden for c in found if c.kind == "effect"}
    # What does nothing by itself cannot be hidden alone.
    assert set(EFFECTS.names()) - hidden == {"body_lift_stall", "drag_only_current"}
    assert hidden < set(EFFECTS.names())
    nothing = [c for c in found if c.part == "nothing"]
    assert len(nothing) == 200 == len({c.seed for c in nothing})
    assert {c.coefficients for c in found} == {"drawn"}
    # No two parts share a seed, so that no two logs share their noise.
    seeds = {part: {c.seed for c in found if c.part == part} for part in {c.part for c in found}}
    assert sum(map(len, seeds.values())) == len(set().union(*seeds.values()))


def test_a_plant_that_is_not_there_is_refused_before_anything_is_run():
    with pytest.raises(ConfigError, match="jupiter"):
        cases({**OPTIONS, "plants": "jupiter"})
