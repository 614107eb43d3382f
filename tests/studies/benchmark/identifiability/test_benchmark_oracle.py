"""The oracle against dense least squares and closed forms, and what is counted in worlds against rows made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from auvnn.models import load
from auvnn.simulation import simulate
from auvnn.studies.benchmark.counts.rates import rate
from auvnn.studies.benchmark.counts.worlds import (
    adequate,
    alone,
    false_names,
    force_right,
    right,
    silent,
    visible,
    wrong_first,
)
from auvnn.studies.benchmark.identifiability.oracle import NONE, Oracle
from auvnn.studies.benchmark.identifiability.oracle_filter import FIRST, WHITE, Noise, information
from auvnn.studies.benchmark.identifiability.oracle_slopes import Course, accelerations


@pytest.mark.parametrize("memory", [0.0, 0.4])
def test_the_filter_holds_the_information_of_dense_least_squares(memory):
    # All outputs of one short run stacked, with their joint covariance written out: the same information.
    rng = np.random.default_rng(2)
    steps, unknown, h = 5, 3, 0.1
    transition = np.eye(18) + 0.1 * rng.normal(size=(1, steps, 18, 18))
    times, rms = np.full(6, 0.7), np.linspace(0.5, 2.0, 6)
    transition[..., 12:, :12], transition[..., 12:, 12:] = 0.0, np.diag(np.exp(-h / times))
    push, seen = rng.normal(size=(1, steps, 12, unknown)), rng.normal(size=(1, steps + 1, 12, unknown))
    sigma, further = rng.uniform(0.5, 1.5, 12), rng.uniform(0.0, 0.2, (1, steps + 1, 12))
    measured = rng.uniform(size=(1, steps + 1, 12)) < 0.8
    found = information(transition, push, seen, h, Noise(sigma, memory, further, measured, rms, times))

    # State k as a linear map of the first state and of the shocks.
    size = 18 + 6 * steps
    maps, slopes = [np.hstack([np.eye(18), np.zeros((18, 6 * steps))])], [np.zeros((18, unknown))]
    for k in range(steps):
        after = transition[0, k] @ maps[-1]
        after[12:, 18 + 6 * k : 24 + 6 * k] = np.eye(6)
        maps.append(after)
        slopes.append(transition[0, k] @ slopes[-1] + np.vstack([push[0, k], np.zeros((6, unknown))]))
    shocks = np.concatenate([FIRST**2, rms**2, np.tile(rms**2 * (1.0 - np.exp(-2.0 * h / times)), steps)])
    assert len(shocks) == size
    outputs = np.vstack([m[:12] for m in maps])
    gradient = np.vstack([s[:12] + seen[0, k] for k, s in enumerate(slopes)])
    cover = outputs @ np.diag(shocks) @ outputs.T + np.diag(further[0].ravel())
    lags = np.abs(np.subtract.outer(np.arange(steps + 1), np.arange(steps + 1))) * h
    alike = np.exp(-lags / memory) + WHITE * np.eye(steps + 1) if memory else np.eye(steps + 1)
    cover += np.kron(alike, np.diag(sigma**2))
    keep = measured[0].ravel()
    expected = gradient[keep].T @ np.linalg.solve(cover[np.ix_(keep, keep)], gradient[keep])
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.fixture(scope="module")
def made():
    model = load("rov95")
    hidden = {"net_buoyancy": {"force": 6.0}}
    return model, simulate(
        model, "multisine", "realistic", hidden, seed=3, runs=2, duration=6.0, plant="numpy", max_step=0.025
    )


def test_the_course_reproduces_the_accelerations_of_the_plant(made):
    _, log = made
    course = Course.of(log.task, log.motion, 2)
    found = accelerations(course, log.task.effects)
    whole = log.motion.nu[:, course.rows]
    by_motion = np.diff(whole, axis=1) / course.step
    # The mean acceleration over a step is that at its middle, up to its curvature.
    assert np.abs(found - by_motion).max() < 0.02 * np.abs(by_motion).max()


def test_the_oracle_sees_in_proportion_and_less_beside_a_rival(made):
    model, log = made
    oracle = Oracle(model, log, 2, ["net_buoyancy"])
    seen = oracle.distances(["constant_force", "thruster_lag"])["net_buoyancy"]
    twice = simulate(
        model, "multisine", "realistic", {"net_buoyancy": {"force": 12.0}}, seed=3, runs=2, duration=6.0,
        plant="numpy", max_step=0.025,
    )  # fmt: skip
    assert Oracle(model, twice, 2, ["net_buoyancy"]).distances()["net_buoyancy"][NONE] == pytest.approx(
        2.0 * seen[NONE], rel=0.1
    )
    assert seen["constant_force"] < 0.5 * seen[NONE], "a force along z is the same but for the tilt"
    assert 0.9 * seen[NONE] < seen["thruster_lag"] <= seen[NONE] + 1e-6


def test_a_wandering_force_hides_what_does_not_stand_out():
    model, hidden = load("rov95"), {"net_buoyancy": {"force": 6.0}}
    how: dict[str, Any] = dict(seed=3, runs=1, duration=6.0, plant="numpy", max_step=0.025)
    seen = []
    for world in (None, "disturbed_10", "disturbed_25"):
        log = simulate(model, "multisine", "realistic", hidden, world=world, **how)
        seen.append(Oracle(model, log, 1, ["net_buoyancy"]).distances()["net_buoyancy"][NONE])
    assert seen[0] > 3.0 * seen[1] and 1.5 < seen[1] / seen[2] < 3.5


def test_the_oracle_sees_a_stranger_in_proportion_and_less_beside_what_has_its_mean():
    model, seen = load("rov95"), []
    how: dict[str, Any] = dict(seed=3, runs=2, duration=6.0, plant="numpy", max_step=0.025)
    for strength in (0.05, 0.1):
        log = simulate(model, "multisine", "realistic", {"stranger_turn_roll": {"strength": strength}}, **how)
        oracle = Oracle(model, log, 2, ["stranger_turn_roll"])
        seen.append(oracle.distances(["cg_offset", "net_buoyancy"])["stranger_turn_roll"])
    assert seen[1][NONE] == pytest.approx(2.0 * seen[0][NONE], rel=0.1)
    assert 0.0 < seen[0]["cg_offset"] < 0.8 * seen[0][NONE], "a moment with one sign has a mean"
    assert seen[0]["net_buoyancy"] == pytest.approx(seen[0][NONE], rel=0.05), "a force in heave turns nothing"


def row(hidden: str, *found: tuple[str, list[str]], true=(), kind="effect", **more: Any) -> dict[str, Any]:
    return {
        "hidden": hidden, "kind": kind, "world": "w", "verdict": found[0][0], "made": True,
        "missing": [n for v, names in found if v in ("named", "ambiguous") for n in names],
        "found": [{"verdict": v, "effects": n} for v, n in found], "world_law": {"true_names": list(true)},
        "oracle_distances": {hidden: {"nothing": 9.0, "b": 2.0, "c": 8.0}}, "cost": 0.4, **more,
    }  # fmt: skip


END = ("adequate", [])


def test_a_hit_is_first_or_rightly_tied():
    assert right(row("a", ("named", ["a"]), END)) and alone(row("a", ("named", ["a"]), END))
    tied, untied = row("a", ("ambiguous", ["a", "b"])), row("a", ("ambiguous", ["a", "c"]))
    assert right(tied) and not alone(tied) and not right(untied)
    assert not right(row("a", ("partial", []), nearest=["a"])), "partial never counts as named"
    assert not wrong_first(row("a", ("partial", []), nearest=["a", "c"]))
    assert wrong_first(row("a", ("partial", []), nearest=["c", "a"]))
    assert wrong_first(row("a", ("named", ["c"]))) and wrong_first(row("a", ("ambiguous", ["b", "c"])))
    assert not wrong_first(row("a", ("unknown", [])))


def test_what_is_true_in_a_world_is_neither_a_hit_nor_an_error():
    first = row("a", ("named", ["t"]), ("named", ["a"]), END, true=["t"])
    assert right(first) and alone(first) and not wrong_first(first) and false_names(first) == []
    only = row("a", ("named", ["t"]), END, true=["t"])
    assert not right(only) and not wrong_first(only)
    assert right(row("a", ("ambiguous", ["a", "t"]), true=["t"])), "what is left of the group is the name"
    assert right(row("t", ("named", ["t"]), END, true=["t"], oracle_distances={"t": {"nothing": 9.0}})), (
        "it is hidden here"
    )
    nothing = row("nothing", ("named", ["t"]), END, true=["t"], kind="nothing")
    assert adequate(nothing) and silent(nothing)
    # A name that was withdrawn was not given, though it came first.
    gone = [("named", ["c"]), ("named", ["t"]), ("withdrawn", ["c"]), END]
    assert adequate(row("nothing", *gone, true=["t"], kind="nothing", missing=["t"]))
    assert not adequate(row("nothing", *gone, kind="nothing", missing=["t"]))
    wrong = row("nothing", ("named", ["t"]), ("named", ["c"]), END, true=["t"], kind="nothing")
    assert not adequate(wrong) and not silent(wrong) and wrong_first(wrong)
    assert silent(row("nothing", ("unknown", []), kind="nothing"))
    assert not silent(row("nothing", ("partial", []), nearest=["c"], kind="nothing"))


def test_after_a_group_that_is_true_in_a_world_the_next_step_is_the_first():
    """An ambiguous answer says the members of its first group alone to be missing."""
    group, true = ("ambiguous", ["t", "s"]), {"true": ["t", "s"], "missing": ["t", "s"]}
    hit, miss = row("a", group, ("named", ["a"]), **true), row("a", group, ("named", ["c"]), **true)
    assert right(hit) and alone(hit) and not wrong_first(hit)
    assert wrong_first(miss) and not right(miss)
    assert wrong_first(row("a", group, ("ambiguous", ["b", "c"]), **true))
    # What a later step has withdrawn was not said; nor is there anything right or wrong where nothing comes after.
    gone = row("a", group, ("named", ["c"]), ("named", ["a"]), ("withdrawn", ["c"]), **true)
    assert right(gone) and not wrong_first(gone)
    assert not wrong_first(row("a", group, END, **true)) and not right(row("a", group, END, **true))


def test_visible_is_seen_and_costly():
    assert visible(row("a", END))
    assert not visible(row("a", END, cost=0.09)) and not visible(
        row("a", END, oracle_distances={"a": {"nothing": 4.9}})
    )
    assert not visible(row("a", END, oracle_distances=None)), "nobody asked"
    rows = [row("a", ("named", ["a"])), row("a", END), row("a", ("named", ["a"]), cost=0.01)]
    assert [rate("visible_named_or_tied", rows)[k] for k in ("hits", "count")] == [1, 2]
    assert [rate("visible", rows)[k] for k in ("hits", "count")] == [2, 3]
    assert rate("visible_named_or_tied", [{**r, "world": ""} for r in rows])["share"] is None


def test_the_force_that_is_left_is_compared_by_size_and_memory():
    law = {"drawn": {"force": {"rms": [10.0, 5.0, 0.1, 0.0, 1.0, 1.0], "correlation": [1.0] * 6}}}
    left = {
        "X": {"rms": 11.9, "correlation_time": 1.9}, "Y": {"rms": 6.1, "correlation_time": 1.0},
        "M": {"rms": 1.0, "correlation_time": 2.1}, "N": {"rms": None, "correlation_time": None},
    }  # fmt: skip
    # Z is below a twentieth of the largest force, K is not disturbed.
    assert force_right(row("nothing", END, kind="nothing", world_law=law, left=left)) == [
        True,
        False,
        False,
        False,
    ]
