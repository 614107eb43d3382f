"""Rates, intervals, targets and power, from rows made by hand and counted by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from auvnn.errors import ConfigError
from auvnn.studies.benchmark import summarise
from auvnn.studies.benchmark.cases import Case
from auvnn.studies.benchmark.counts.counting import (
    STRICT,
    TIED,
    all_named,
    all_shown_named,
    false_names,
    given_names,
    named_alone,
    named_or_tied,
    right_axis,
    wrapped,
)
from auvnn.studies.benchmark.counts.power import smallest_found
from auvnn.studies.benchmark.counts.rates import by_part, interval, judged, rate, z_of
from auvnn.studies.benchmark.falls import names_to_add
from auvnn.studies.benchmark.one_log import errors_of


def row(hidden: str, *found: tuple[str, list[str]], kind: str = "effect", size: str = "medium", **more: Any):
    """Return a row whose answer is given step by step."""
    plain = {
        "vehicle": "rov95", "hidden": hidden, "size": "none" if kind == "nothing" else size, "noise": "realistic",
        "excitation": "multisine", "seed": 1, "seconds": 1.0, "kind": kind, "fault": None, "errors": {},
        "verdict": found[0][0], "missing": [n for _, names in found for n in names],
        "found": [{"verdict": v, "effects": n} for v, n in found], "part": "p",
    }  # fmt: skip
    return {**plain, **more}


def named(*names: str) -> list[tuple[str, list[str]]]:
    return [*(("named", [n]) for n in names), ("adequate", [])]


GROUP = [("ambiguous", ["a", "b"])]


def test_a_group_counts_where_no_one_can_tell_its_members_apart():
    assert named_or_tied(row("a", *named("a")))
    assert not named_or_tied(row("a", *named("b")))
    assert named_or_tied(row("a", *GROUP, imitation={"a": {"nothing": 9.0, "b": 3.2}}))
    assert not named_or_tied(row("a", *GROUP, imitation={"a": {"nothing": 9.0, "b": 3.4}}))
    silent = [("adequate", [])]
    assert named_or_tied(row("a", *silent, imitation={"a": {"nothing": 3.2}})), "there was nothing to see"
    assert not named_or_tied(row("a", *silent, imitation={"a": {"nothing": 3.4}}))
    assert not named_or_tied(row("a", *silent))
    assert not named_or_tied(row("a", *named("b"), imitation={"a": {"nothing": 0.0}})), (
        "a wrong name is wrong"
    )
    assert not named_or_tied(row("a", *GROUP)), "nobody has shown it"
    assert not named_or_tied(row("c", *GROUP, imitation={"c": {"a": 0.0, "b": 0.0}})), "not a member"
    three = [("ambiguous", ["a", "b", "c"])]
    assert named_or_tied(row("a", *three, imitation={"a": {"b": 1.0, "c": 0.5}}))
    assert not named_or_tied(row("a", *three, imitation={"a": {"b": 1.0, "c": 5.0}}))


def test_the_independent_plant_has_the_last_word():
    both = {"imitation": {"a": {"b": 0.1}}, "plant_imitation": {"a": {"b": 7.0}}}
    assert not named_or_tied(row("a", *GROUP, **both))


def test_named_alone_is_named_and_nothing_besides():
    assert named_alone(row("a", *named("a"))) and not named_alone(row("a", *named("a", "b")))
    assert named_alone(row("a+b", *named("b", "a"), kind="several"))
    assert not named_alone(row("a", *GROUP))


def test_several_are_found_when_each_of_them_is():
    def found(*answer: tuple[str, list[str]], **more: Any) -> bool:
        return all_named(row("a+b", *answer, kind="several", **more))

    assert found(*named("b", "a")) and found(*named("a", "c", "b"))
    assert not found(*named("a")) and not found(("unknown", []))
    later = [("named", ["a"]), ("ambiguous", ["b", "c"])]
    assert not found(*later) and found(*later, imitation={"b": {"c": 0.3}})
    # "One or the other" is not both.
    assert not found(*GROUP)


def test_what_the_log_cannot_show_need_not_be_named():
    def found(*answer: tuple[str, list[str]], hidden: str = "a+b", **distance: float) -> bool:
        told = {e: {"nothing": d} for e, d in distance.items()}
        return all_shown_named(row(hidden, *answer, kind="several", imitation=told))

    assert found(*named("a"), a=20.0, b=1.0) and not found(*named("a"), a=20.0, b=5.0)
    # What is not known to be hidden from the log must be named; and what was named is right however small.
    assert not found(*named("a"), a=20.0) and found(*named("a", "b"), a=20.0, b=1.0)
    assert found(("adequate", []), a=1.0, b=2.0) and not found(("unknown", []), a=1.0, b=2.0)
    assert not found(*named("c"), a=1.0, b=2.0)


def test_members_of_a_later_group_are_no_false_names():
    assert false_names(row("a", ("named", ["a"]), ("ambiguous", ["b", "c"]))) == []
    assert false_names(row("a", *named("a", "b"))) == ["b"]
    assert false_names(row("s", *named("b"), kind="stranger")) == ["b"]
    assert false_names(row("a+b", *named("b", "c"), kind="several")) == ["c"]


def test_what_was_withdrawn_is_no_name_that_was_given():
    answer = [("named", ["b"]), ("named", ["a"]), ("withdrawn", ["b"]), ("adequate", [])]
    right = row("a", *answer, missing=["a"])
    assert false_names(right) == [] and given_names(right) == ["a"] and all_named(right)
    wrong = row("b", *answer, missing=["a"])
    assert false_names(wrong) == ["a"] and not all_named(wrong)


def test_rates_have_wilsons_intervals():
    rows = [row("a", *named("a"))] * 19 + [row("a", *named("b"))]
    found = rate("named_first", rows)
    assert (found["hits"], found["count"], found["share"]) == (19, 20, 0.95)
    p, n, z = 0.95, 20, stats.norm.ppf(0.975)
    middle, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert [found["low"], found["high"]] == pytest.approx(
        [(middle - half) / (1 + z**2 / n), (middle + half) / (1 + z**2 / n)]
    )


def test_the_interval_of_a_mean_of_shares_stays_within_zero_and_one():
    """As scipy's Wilson interval where all are 0 or 1, and one that holds the mean in between."""
    for hits in (0, 1, 3, 20):
        known = stats.binomtest(hits, 20).proportion_ci(0.95, method="wilson")
        assert interval(hits, 20) == pytest.approx((known.low, known.high), abs=1e-12)
    low, high = interval(0.5, 20)
    assert 0.0 < low < 0.025 < high < 1.0
    found = rate("false_discovery_rate", [row("a", *named("a"))] * 3)
    # Three right answers do not show that none can be wrong.
    assert found["share"] == 0.0 and found["low"] == 0.0 and found["high"] > 0.5


def test_nothing_to_count_is_no_rate():
    assert rate("named_first", [])["share"] is None and rate("median_fall", [])["share"] is None
    with pytest.raises(ConfigError, match="named_first"):
        rate("named_frist", [])


def test_each_rate_counts_its_own_kind():
    rows = [
        row("a", *named("a")), row("a", *GROUP, imitation={"a": {"nothing": 4.0, "b": 1.0}}),
        row("a", *named("b"), imitation={"a": {"nothing": 4.0, "b": 3.5}}),
        row("a+b", *named("a", "b"), kind="several"),
        row("s", ("unknown", []), kind="stranger", axis="X", axes_true=["X"]),
        row("s", *named("c"), kind="stranger", axis=None, axes_true=["X"]),
        row("nothing", ("adequate", []), kind="nothing"),
        row("nothing", ("fault", []), kind="nothing", fault="it broke", made=True),
        row("a", ("fault", []), fault="a leaves no trace", made=False),
    ]  # fmt: skip
    found = {e["rate"]: (e["hits"], e["count"]) for e in by_part(rows) if e["part"] == "all"}
    assert found == {
        "named_first": (1, 3), "named_alone": (1, 3), "named_or_in_group": (2, 3), "named_or_tied": (2, 3),
        "named_or_tied_at_2": (2, 3),
        "all_named": (1, 1), "all_shown_named": (1, 1), "several_named_alone": (1, 1), "adequate_with_nothing": (1, 2),
        "unknown_with_stranger": (1, 2), "axis_of_stranger": (1, 2),
        # Given: a; b; a and b; c. Wrong: b and c.
        "false_names": (2, 5), "exact_ties": (1, 2), "unseen": (0, 2), "faults": (2, 9), "not_made": (1, 9),
        # The share of each log that is no fault: 0, 0, 1, 0, 0, 1, 0.
        "false_discovery_rate": (None, 7),
    }  # fmt: skip
    assert rate("false_discovery_rate", rows)["share"] == pytest.approx(2 / 7)


def test_a_tie_is_where_the_best_decision_errs_one_time_in_twenty():
    """Two explanations d apart, equal odds: the likelier one is wrong with Phi(-d/2), by simulation."""
    assert stats.norm.cdf(-0.5 * TIED) == pytest.approx(0.05, abs=2e-4)
    errors = np.random.default_rng(0).normal(size=200_000) > 0.5 * TIED
    assert errors.mean() == pytest.approx(0.05, abs=0.002)
    close = row("a", *GROUP, imitation={"a": {"nothing": 9.0, "b": 2.5}})
    assert named_or_tied(close) and not named_or_tied(close, STRICT)


def test_the_degree_of_freedom_must_be_said():
    assert right_axis({"axis": "N", "axes_true": ["N"]})
    assert not right_axis({"axis": None, "axes_true": ["N"]}) and not right_axis({})


def test_intervals_are_counted_of_what_was_named():
    errors = {"a.x": {"relative": 0.1, "z": 0.5}, "b.x": {"relative": 0.1, "z": 3.0},
              "b.y": {"relative": None, "z": None}}  # fmt: skip
    assert z_of(row("a+b", *named("a", "b"), kind="several", errors=errors)) == [0.5, 3.0]
    assert z_of(row("a+b", *named("a"), kind="several", errors=errors)) == [0.5]
    assert z_of(row("a", *named("b"), errors={"x": {"relative": 1.0, "z": 9.0}})) == []


def test_the_median_has_the_interval_of_its_order_statistics():
    rows = [row("a", *named("a"), fall={"share": s}) for s in np.linspace(0.0, 1.0, 11)]
    found = rate("median_fall", rows)
    assert found["share"] == pytest.approx(0.5) and found["count"] == 11
    # Of 11, the 2nd and the 10th hold the median with 1 - 2 (1 + 11) / 2^11 = 98.8 %, the 3rd and 9th with 93.5 %.
    assert (found["low"], found["high"]) == pytest.approx((0.1, 0.9))
    few = rate("median_fall", rows[:3])
    assert few["share"] is not None and few["low"] is None


def test_a_target_is_met_or_missed_or_not_measured():
    rows = [row("a", *named("a"), size=s, part="one") for s in ("medium", "large")]
    rows += [row("a", ("adequate", []), size="small", part="one"), row("a", *named("b"), part="two")]
    aims = [
        {"part": "one", "rate": "named_first", "least": 0.9},
        {"part": "one", "rate": "named_first", "least": 0.9, "sizes": ["medium", "large"]},
        {"part": "all", "rate": "false_names", "most": 0.1},
        {"part": "two", "rate": "all_named", "least": 0.9},
        {"part": "all", "rate": "coverage_95", "least": 0.92, "most": 0.98},
    ]
    found = judged(rows, aims)
    assert [a["met"] for a in found] == [False, True, False, None, None]
    assert found[0]["share"] == pytest.approx(2 / 3) and found[2]["share"] == pytest.approx(1 / 3)


def test_whoever_believes_an_answer_adds_the_first_of_a_group():
    assert names_to_add([{"verdict": "named", "effects": ["a"]}, {"verdict": "ambiguous", "effects": ["b", "c"]}]) == [
        "a", "b",
    ]  # fmt: skip
    assert names_to_add([{"verdict": "adequate", "effects": []}]) == []


def test_the_smallest_size_is_that_of_the_curve_behind_the_answers():
    # P = expit(-6 + 3 ln s): nine in ten at exp((6 + ln 9) / 3).
    truth = float(np.exp((6 + np.log(9)) / 3))
    generator = np.random.default_rng(0)
    sizes = np.repeat([3.0, 5.0, 10.0, 30.0], 400)
    found = generator.uniform(size=len(sizes)) < 1 / (1 + np.exp(6 - 3 * np.log(sizes)))
    curve = smallest_found(list(sizes), list(found))
    assert curve["determined"] and curve["size"] == pytest.approx(truth, rel=0.1)
    assert curve["low"] < truth < curve["high"] and curve["words"] == "between 10 and 30"


def test_the_interval_of_the_smallest_size_holds_it_as_often_as_it_says():
    truth, held = float(np.exp((6 + np.log(9)) / 3)), []
    sizes = np.repeat([3.0, 5.0, 10.0, 30.0], 50)
    for seed in range(60):
        found = np.random.default_rng(seed).uniform(size=200) < 1 / (1 + np.exp(6 - 3 * np.log(sizes)))
        curve = smallest_found(list(sizes), list(found))
        held.append(curve["size"] is not None and curve["low"] < truth < curve["high"])
    assert sum(held) >= 51  # fewer than that of 60 at 95 % happen once in five hundred times


@pytest.mark.parametrize(
    "found, words",
    [
        ([True] * 9, "at most 5, the smallest tried"),
        ([False] * 9, "more than 30, the largest tried"),
        ([True] * 2, "too few logs or sizes"),
    ],
)
def test_where_there_is_no_smallest_size_it_says_why(found, words):
    sizes = [5.0, 10.0, 30.0] * 3
    curve = smallest_found(sizes[: len(found)], found)
    assert curve["size"] is None and not curve["determined"] and curve["words"] == words


def test_a_sharp_edge_is_bracketed():
    curve = smallest_found([5.0] * 5 + [10.0] * 5 + [30.0] * 5, [False] * 5 + [True] * 10)
    assert curve["words"] == "between 5 and 10" and curve["size"] is not None and 5 < curve["size"] < 30


def test_the_summary_says_it_all_by_effect():
    rows = [row("net_buoyancy", *named("net_buoyancy"), size=s, fall={"share": f})
            for s, f in (("medium", 0.8), ("medium", 1.0), ("large", 0.9))]  # fmt: skip
    rows += [row("net_buoyancy", ("adequate", []), size="small", fall={"share": 0.0}),
             row("nothing", ("adequate", []), kind="nothing", p_values={"net_buoyancy": 0.01, "tether": 0.7}),
             row("s", ("unknown", []), kind="stranger"),
             row("a+b", *named("a", "b"), kind="several")]  # fmt: skip
    answer = summarise(rows, {})
    (effect,) = answer.effects
    assert (effect["effect"], effect["logs"], effect["named_first"]["hits"]) == ("net_buoyancy", 4, 3)
    assert effect["median_fall"] == pytest.approx(0.85)
    assert list(effect["by_size"]) == ["small", "medium", "large"]
    assert effect["by_size"]["medium"]["named_first"]["hits"] == 2
    assert answer.confusion == {
        "net_buoyancy": {"net_buoyancy": 3, "adequate": 1}, "nothing": {"adequate": 1}, "s": {"unknown": 1},
    }  # fmt: skip
    assert (
        answer.uniformity["net_buoyancy"]["below_0.05"] == 1
        and answer.uniformity["tether"]["below_0.05"] == 0
    )
    metrics = answer.metrics
    assert (metrics["logs_with_effect"], metrics["logs_with_several"], metrics["logs_with_stranger"]) == (
        4,
        1,
        1,
    )
    assert metrics["median_fall_share"] == pytest.approx(0.85)


def test_rows_of_several_versions_of_the_code_are_warned_of():
    rows = [row("a", *named("a"), code=c) for c in ("1", "2")]
    assert "2 versions of the code" in summarise(rows, {}).warnings[0]
    assert summarise(rows[:1], {}).warnings == []


def test_an_angle_is_the_same_a_whole_turn_later():
    """A phase of 3.13 rad is 0.023 rad from one of -3.13 rad; a rate of 6.26 is not the same as none."""
    turn, std = 2.0 * np.pi, 0.01
    told = {
        "phase": {"value": -3.13, "std": std, "unit": "rad"},
        "rate": {"value": 6.26, "std": std, "unit": "rad/s"},
    }
    errors = {n: {"relative": None, "z": -6.26 / std} for n in told}
    short, long = (turn - 6.26) / std, -6.26 / std
    assert z_of(row("a", *named("a"), errors=errors, parameters=told)) == pytest.approx([short, long])
    several = row(
        "a+b", *named("a", "b"), kind="several", parameters={"a": told, "b": None},
        errors={"a.phase": errors["phase"], "a.rate": errors["rate"], "b.phase": errors["phase"]},
    )  # fmt: skip
    assert z_of(several) == pytest.approx([short, long, long])
    assert wrapped(-3.128 - np.pi, "rad") == pytest.approx(0.0136, abs=1e-4) and wrapped(-6.27, "1") == -6.27


def test_the_error_of_a_phase_goes_the_shorter_way_round():
    """A wave against its amplitude's sign, whose phase is half a turn off, is the same wave."""
    truth = {"waves": {"amplitude": -0.09, "omega": 1.4, "phase": 0.0, "direction": 0.9}}
    told = {n: {"value": v, "std": 0.01, "unit": u} for n, v, u in (
        ("amplitude", 0.09, "m"), ("omega", 1.4, "rad/s"), ("phase", 0.02 - np.pi, "rad"), ("direction", 0.9, "rad"),
    )}  # fmt: skip
    case = Case(
        "rov95", "waves", "medium", "realistic", "multisine", "drawn", 1, runs=2, duration=30.0, rate=20.0
    )
    errors = errors_of(case, truth, told)
    assert errors["phase"]["z"] == pytest.approx(2.0) and errors["amplitude"]["z"] == pytest.approx(0.0)
