"""Cases, and rates counted from rows made by hand; one small log goes the whole way."""

from __future__ import annotations

import math
from typing import Any

import pytest

from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError
from auvnn.studies import benchmark as study
from auvnn.studies.benchmark import (
    Case,
    benchmark,
    cases,
    false_names,
    in_group,
    named_first,
    run_case,
    summarise,
)

OPTIONS: dict[str, Any] = {
    "effects": "all", "sizes": ["medium", "large"], "noises": "realistic", "excitations": "multisine",
    "vehicles": "rov95", "coefficients": "exact", "repeats": 3, "seed": 1000, "runs": 4, "duration": 60,
    "rate": 20, "workers": 1,
}  # fmt: skip
TINY = {**OPTIONS, "effects": "net_buoyancy", "sizes": "medium", "repeats": 1, "runs": 2, "duration": 20,
        "rate": 10}  # fmt: skip


def row(
    hidden: str, verdict: str, *missing: str, size: str = "medium", noise: str = "realistic", **more: Any
) -> dict[str, Any]:
    """Return a row as `run_case` does; `errors` are pairs of relative error and z."""
    errors = {f"p{k}": {"relative": e, "z": z} for k, (e, z) in enumerate(more.pop("errors", []))}
    plain = {
        "vehicle": "rov95", "hidden": hidden, "size": "none" if hidden == "nothing" else size, "noise": noise,
        "excitation": "multisine", "coefficients": "exact", "seed": 1, "runs": 4, "duration": 60.0,
        "rate": 20.0, "verdict": verdict, "missing": list(missing), "seconds": 10.0,
    }  # fmt: skip
    # A fault ends before there is anything to be wrong about.
    rest = {"fault": "it broke"} if verdict == "fault" else {"fault": None, "errors": errors}
    return {**plain, **rest, **more}


# Ten logs with an effect and five with nothing; what they should count as stands beside each.
ROWS = [
    row("ocean_current", "named", "ocean_current", errors=[(0.02, 0.5), (0.01, -3.0)]),  # right
    row("ocean_current", "named", "ocean_current", errors=[(0.05, 2.5), (0.03, -0.1)]),  # right
    row("ocean_current", "named", "ocean_current", "cg_offset", errors=[(0.04, 1.0)]),  # one name too many
    row("ocean_current", "named", "constant_force", errors=[(0.9, 9.0)]),  # wrong name
    row("ocean_current", "named", "constant_force", "ocean_current", errors=[(0.8, 8.0)]),  # wrong first
    row("ocean_current", "ambiguous", "constant_force", "ocean_current"),  # in the group
    row("ocean_current", "ambiguous", "constant_force", "cg_offset"),  # not in the group
    row("cg_offset", "unknown", size="large"),
    row("cg_offset", "adequate", size="large"),
    row("cg_offset", "fault", size="large", seconds=50.0),
    row("nothing", "adequate", seconds=2.0),
    row("nothing", "adequate", seconds=2.0),
    row("nothing", "adequate", seconds=2.0),
    row("nothing", "named", "thruster_lag"),
    row("nothing", "unknown"),
]


def test_there_is_a_case_for_every_combination():
    found = cases({**OPTIONS, "effects": ["ocean_current", "cg_offset"], "noises": ["none", "realistic"],
                   "excitations": ["multisine", "survey"], "vehicles": ["rov95", "rov90"]})  # fmt: skip
    assert len(found) == len(set(found)) == 2 * 2 * 2 * 2 * 2 * 3
    assert {(c.vehicle, c.hidden, c.size, c.noise, c.excitation) for c in found} == {
        (v, h, s, n, e)
        for v in ("rov95", "rov90")
        for h in ("ocean_current", "cg_offset")
        for s in ("medium", "large")
        for n in ("none", "realistic")
        for e in ("multisine", "survey")
    }
    assert {(c.coefficients, c.runs, c.duration, c.rate) for c in found} == {("exact", 4, 60.0, 20.0)}


def test_each_repeat_has_a_seed_of_its_own():
    nothing = [c.seed for c in cases({**OPTIONS, "effects": "nothing"})]
    assert nothing == [1000, 1001, 1002]
    # No two effects are hidden under the same noise, and none changes with what else is asked for.
    both = cases({**OPTIONS, "effects": ["cg_offset", "waves"], "sizes": "small"})
    assert len({c.seed for c in both}) == 6
    assert [c for c in both if c.hidden == "waves"] == cases(
        {**OPTIONS, "effects": "waves", "sizes": "small"}
    )
    everything = {
        c.hidden: c.seed for c in cases({**OPTIONS, "effects": "all", "strangers": "all", "repeats": 1})
    }
    assert len(set(everything.values())) == len(everything) > 40


def test_all_is_the_catalogue_without_what_such_a_log_says_nothing_of():
    # No fins, no stated battery, no kind of drag that is not stated, accelerations only where they are measured, and what
    # does nothing by itself.
    absent = {
        "unstated_damping",
        "drag_only_current",
        "body_lift_stall",
        "fin_stall",
        "fin_gain",
        "fin_offset",
        "fin_drag",
        "fin_lag",
        "voltage_droop",
    }
    assert {c.hidden for c in cases({**OPTIONS, "noises": "none"})} == set(EFFECTS.names()) - absent
    for more in ({}, {"noises": "none", "accelerations": False}):
        found = {c.hidden for c in cases({**OPTIONS, **more})}
        assert found == set(EFFECTS.names()) - {*absent, "accelerometer_tilt"}
    assert {"fin_stall", "unstated_damping"} <= {c.hidden for c in cases({**OPTIONS, "vehicles": "remus100"})}
    assert [c.hidden for c in cases({**OPTIONS, "effects": "fin_stall", "repeats": 1})] == ["fin_stall"] * 2


def test_nothing_has_no_size_and_so_occurs_once():
    found = cases({**OPTIONS, "effects": ["cg_offset", "nothing"]})
    assert [c.size for c in found if c.hidden == "nothing"] == ["none"] * 3
    assert len([c for c in found if c.hidden == "cg_offset"]) == 6


def test_an_unknown_effect_is_refused_before_anything_is_run():
    with pytest.raises(AuvnnError, match=r"'cg_ofset'.*'cg_offset'"):
        cases({**OPTIONS, "effects": ["cg_ofset"]})


def test_rates_are_those_counted_by_hand():
    metrics = summarise(ROWS, OPTIONS).metrics
    expected = {
        "logs": 15, "logs_with_effect": 10, "logs_with_nothing": 5, "named_first_share": 3 / 10,
        "named_or_in_group_share": 4 / 10, "adequate_with_nothing": 3, "false_alarms_with_nothing": 2,
        "faults": 1,
        # Five z of logs that were named first: 0.5, -3.0, 2.5, -0.1, 1.0.
        "coverage_95_share": 3 / 5, "worst_relative_error": 0.05, "median_seconds": 10.0,
    }  # fmt: skip
    assert {k: metrics[k] for k in expected} == pytest.approx(expected)


def test_a_false_discovery_is_a_given_name_that_is_not_hidden():
    # Given: 1 + 1 + 2 + 1 + 2 with a current hidden, 1 with nothing; wrong are cg_offset, constant_force
    # twice, and the lag.
    assert summarise(ROWS, OPTIONS).metrics["false_discovery_share"] == pytest.approx(4 / 8)
    assert [false_names(r) for r in ROWS] == [
        [], [], ["cg_offset"], ["constant_force"], ["constant_force"], [], [], [], [], [], [], [], [],
        ["thruster_lag"], [],
    ]  # fmt: skip


def test_right_and_in_a_group_are_told_apart():
    assert [named_first(r) for r in ROWS] == [True] * 3 + [False] * 12
    assert [in_group(r) for r in ROWS] == [True] * 3 + [False, False, True] + [False] * 9


def test_the_table_has_a_line_for_each_kind_of_log():
    lines = {(e["hidden"], e["size"]): e for e in summarise(ROWS, OPTIONS).table}
    assert set(lines) == {("ocean_current", "medium"), ("cg_offset", "large"), ("nothing", "none")}
    current, offset, nothing = (lines[k] for k in (("ocean_current", "medium"), ("cg_offset", "large"),
                                                   ("nothing", "none")))  # fmt: skip
    assert (current["logs"], current["named_first"], current["in_group"]) == (7, 3, 4)
    assert current["worst_relative_error"] == pytest.approx(0.05)
    assert current["answers"] == {
        "ocean_current": 2, "ocean_current+cg_offset": 1, "constant_force": 1,
        "constant_force+ocean_current": 1, "ambiguous": 2,
    }  # fmt: skip
    assert (offset["logs"], offset["named_first"], offset["in_group"]) == (3, 0, 0)
    assert offset["answers"] == {"unknown": 1, "adequate": 1, "fault": 1}
    assert offset["worst_relative_error"] is None
    assert (nothing["logs"], nothing["answers"]) == (5, {"adequate": 3, "thruster_lag": 1, "unknown": 1})


@pytest.mark.parametrize("key", ["size", "noise"])
def test_conditions_are_counted_apart(key):
    other = {"size": "large", "noise": "none"}[key]
    rows = [row("cg_offset", "named", "cg_offset"), row("cg_offset", "adequate", **{key: other})]
    lines = {e[key]: e for e in summarise(rows, OPTIONS).table}
    assert [lines[k]["named_first"] for k in (rows[0][key], other)] == [1, 0]


def test_what_cannot_be_counted_is_unknown_and_null_in_json():
    metrics = summarise([row("nothing", "adequate")], OPTIONS).metrics
    assert math.isnan(metrics["named_first_share"]) and math.isnan(metrics["coverage_95_share"])
    assert metrics["false_discovery_share"] == 0.0
    answer = summarise([], OPTIONS).to_dict()
    assert answer["schema"] == "auvnn/benchmark/1" and answer["metrics"]["logs"] == 0
    assert answer["metrics"]["median_seconds"] is None and answer["table"] == []


def test_an_unknown_standard_error_is_left_out_of_the_coverage():
    rows = [row("cg_offset", "named", "cg_offset", errors=[(0.01, math.nan), (0.02, None), (0.03, 1.0)])]
    assert summarise(rows, OPTIONS).metrics["coverage_95_share"] == 1.0


def test_a_fault_is_an_outcome_and_not_the_end(monkeypatch):
    import auvnn.diagnosis

    def breaks(*_: Any, **__: Any) -> None:
        raise AuvnnError("the model diverges")

    monkeypatch.setattr(auvnn.diagnosis, "diagnose", breaks)
    (case,) = cases({**TINY, "effects": "nothing", "duration": 5})
    found = run_case(case)
    assert (found["verdict"], found["fault"], found["missing"]) == ("fault", "the model diverges", [])
    assert found["made"] is True, "the log was there"
    assert summarise([found], OPTIONS).metrics["faults"] == 1


def test_a_log_that_cannot_be_made_is_no_fault_of_the_diagnosis():
    (case,) = cases({**TINY, "effects": "fin_stall", "duration": 5})
    found = run_case(case)
    assert (found["verdict"], found["made"]) == ("fault", False) and found["fault"]
    metrics = summarise([found], OPTIONS).metrics
    assert (metrics["faults"], metrics["not_made"], metrics["logs_with_effect"]) == (1, 1, 0)


def test_an_error_of_the_program_in_one_log_does_not_end_the_others(monkeypatch):
    import auvnn.diagnosis

    def breaks(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(auvnn.diagnosis, "diagnose", breaks)
    (case,) = cases({**TINY, "effects": "nothing", "duration": 5})
    assert run_case(case)["fault"] == "a fault of the program: ZeroDivisionError: division by zero"


def test_rows_keep_the_order_of_the_cases_whichever_ends_first(monkeypatch):
    todo = cases({**OPTIONS, "effects": ["cg_offset", "ocean_current"]})

    def backwards(some: list[Case], workers: int, run: Any):
        assert workers == 2 and run is run_case
        for case in reversed(some):
            yield row(case.hidden, "adequate", size=case.size, seed=case.seed)

    monkeypatch.setattr(study, "run_all", backwards)
    told: list[str] = []
    answer = benchmark({**OPTIONS, "effects": ["cg_offset", "ocean_current"], "workers": 2}, told.append)
    found = [(r["hidden"], r["size"], r["seed"]) for r in answer.rows]
    assert found == [(c.hidden, c.size, c.seed) for c in todo]
    assert len(told) == len(todo) and told[-1].done == len(todo) == told[-1].total


@pytest.fixture(scope="module")
def small() -> dict[str, Any]:
    """One log of two runs of 20 s with a medium net buoyancy, all the way, and a run held out."""
    more = {"held_out": 1, "ties": True, "candidates": ["constant_force", "net_buoyancy", "thruster_lag"]}
    (case,) = cases({**TINY, **more})
    return run_case(case)


def test_one_log_goes_the_whole_way(small):
    assert small["fault"] is None
    assert small["verdict"] in ("named", "ambiguous", "unknown", "adequate")
    assert set(small["missing"]) <= set(EFFECTS.names())
    assert set(small["truth"]) == {"net_buoyancy"} and 0 <= small["p_value"] <= 1 and small["seconds"] > 0
    answer = summarise([small], TINY)
    assert answer.metrics["logs_with_effect"] == 1 and answer.metrics["faults"] == 0
    assert answer.to_dict()["rows"] == [small], "a row is plain data already"


def test_errors_are_relative_to_the_effect_and_in_standard_errors(small):
    found, truth = small["parameters"]["force"], small["truth"]["net_buoyancy"]["force"]
    # The effect vanishes at zero, so its size is the force itself.
    gap = found["value"] - truth
    assert small["errors"]["force"]["relative"] == pytest.approx(abs(gap / truth))
    assert small["errors"]["force"]["z"] == pytest.approx(gap / found["std"])
    # Hidden at ten standard errors of an oracle; whoever knows less cannot be surer, nor miss it by far.
    assert found["std"] > 0.9 * abs(truth) / 10
    assert abs(small["errors"]["force"]["z"]) < 4


def test_what_was_found_is_tried_on_a_run_that_was_held_out(small):
    fall = small["fall"]
    assert fall["fault"] is None and 0 < fall["true"] < fall["refitted"]
    if fall["share"] is not None:
        share = (fall["refitted"] - fall["found"]) / (fall["refitted"] - fall["true"])
        assert fall["share"] == pytest.approx(share)
    # Nothing else than what is hidden does better than by its noise.
    assert fall["found"] > 0.9 * fall["true"]


def test_who_could_pass_for_the_hidden_effect_is_worked_out(small):
    (distances,) = small["imitation"].values()
    assert list(small["imitation"]) == ["net_buoyancy"]
    assert set(distances) == {"nothing", "constant_force", "thruster_lag"}
    # Hidden at ten standard errors of who knows everything else; a rival only helps to explain it away.
    assert 2 < distances["nothing"] < 10.2
    assert all(0 <= d <= distances["nothing"] + 1e-9 for d in distances.values())
