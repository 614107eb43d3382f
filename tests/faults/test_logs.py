"""Rows 26 to 64: stamps that are no time, and signals that no sensor should have given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.logs import Log, Run
from tests.log_samples import frame, make_run, same

RUN = make_run(800, noise=0.005)


def put(table: pl.DataFrame | Run, name: str = "log.csv") -> str:
    """Write a log's file and return its name."""
    (frame(table) if isinstance(table, Run) else table).write_csv(name)
    return name


def with_t(t: np.ndarray) -> pl.DataFrame:
    return frame(RUN).with_columns(pl.Series("t", t))


def scaled(run: Run = RUN, **factors: float) -> pl.DataFrame:
    return frame(run).with_columns((pl.col(n) * f).alias(n) for n, f in factors.items())


# Time


def test_row_26_stamps_that_are_no_number_are_dropped_and_counted(noted):
    t = np.array(RUN.t)
    t[[5, 99, 300]] = np.nan, np.inf, -np.inf
    assert "repair: log.csv: samples without a time stamp dropped (3)" in noted(put(with_t(t)))
    assert np.array_equal(Log.read("log.csv").runs[0].t, np.delete(RUN.t, [5, 99, 300]))


def test_row_27_of_equal_stamps_the_first_is_kept(noted):
    t = np.array(RUN.t)
    t[[50, 51]] = t[49]
    assert "repeated time stamp dropped (the first is kept) (2)" in noted(put(with_t(t)))
    np.testing.assert_array_equal(Log.read("log.csv").runs[0].nu, np.delete(RUN.nu, [50, 51], axis=0))


def test_row_28_late_samples_are_sorted_and_a_clock_set_back_splits(noted):
    order = np.arange(800)
    order[[100, 101, 102]] = 102, 100, 101
    table = frame(RUN)[order]
    assert "out of order sorted by time (largest step back 0.1 s) (1)" in noted(put(table))
    same(Log.read("log.csv").runs[0], RUN)
    t = np.where(np.arange(800) < 400, RUN.t, RUN.t - 15.0)
    found = noted(put(with_t(t)))
    assert "warning: log.csv: time runs backwards (by up to 14.95 s): split into further runs (1)" in found
    assert [r.samples for r in Log.read("log.csv").runs] == [400, 400]


def test_row_32_nothing_is_joined_across_a_gap(noted):
    t = np.where(np.arange(800) < 300, RUN.t, RUN.t + 4.0)
    found = noted(put(with_t(t)))
    assert "warning: run 1: 1 gaps in time, the longest 4.05 s; nothing is interpolated across them" in found
    assert Log.read("log.csv").runs[0].segments() == [slice(0, 300), slice(300, 800)]


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_row_35_a_clock_in_another_unit(refused, factor, unit):
    line = refused("check", f"log={put(with_t(factor * RUN.t))}")
    assert f"is t in {unit}? Mapping: time: {{unit: {unit}}}" in line
    Path("map.yaml").write_text(f"time: {{unit: {unit}}}\n")
    np.testing.assert_allclose(Log.read("log.csv", "map.yaml").runs[0].t, RUN.t, atol=1e-9)


@pytest.mark.parametrize(
    ("t", "words"),
    [
        (RUN.t[:1], "a run needs at least 3"),
        (RUN.t[:2], "a run needs at least 3"),
        (np.full(800, 7.0), "all samples have the same time stamp t = 7 s"),
    ],
    ids=["one", "two", "no time"],
)
def test_row_37_too_short_to_be_a_run(refused, t, words):
    assert words in refused("check", f"log={put(frame(RUN)[: len(t)].with_columns(pl.Series('t', t)))}")


# Signals


def test_row_40_missing_samples_are_masked_and_too_many_refused(noted, refused):
    w = np.array(RUN.nu[:, 2])
    w[100:200] = np.nan
    w[300] = np.inf
    assert "warning: missing: samples missing: w 13 %; they are left out, not filled" in noted(
        put(frame(RUN).with_columns(pl.Series("w", w)))
    )
    assert (~Log.read("log.csv").runs[0].valid).sum() == 101
    w[:450] = np.nan
    line = refused("check", f"log={put(frame(RUN).with_columns(pl.Series('w', w)))}")
    assert "56 % of the required channel 'w' is missing (50 % may be)" in line


def test_row_41_a_frozen_sensor(noted):
    stuck = np.array(RUN.nu[:, 2])
    stuck[200:400] = stuck[200]
    found = noted(put(frame(RUN).with_columns(pl.Series("w", stuck))), level="warning")
    assert "w: stands still for 1 s or longer while others move, 25 % of the log" in found
    found = noted(put(frame(RUN).with_columns(pl.lit(0.25).alias("w"))), level="warning")
    assert "w: never changes from 0.25 while u, v, p, q, r" in found


def test_row_42_thrusters_at_neutral_throughout(noted):
    table = frame(RUN).with_columns(pl.lit(0.0).alias(f"thruster_{i}") for i in range(1, 5))
    found = noted(put(table), level="error")
    assert "excitation: the thrusters are neutral throughout: nothing about thrust, mass or damping" in found
    one = frame(RUN).with_columns(pl.lit(0.0).alias("thruster_3"))
    assert "neutral throughout: thruster_3; nothing can be said of their thrust" in noted(
        put(one), level="warning"
    )


def test_row_43_a_thruster_at_its_limit(noted):
    table = frame(RUN).with_columns(pl.Series("thruster_2", np.where(np.arange(800) % 3 == 0, 0.2, 1.0)))
    found = noted(put(table), level="warning")
    assert "at their limit most of the time: thruster_2; their gain is hard to tell" in found


@pytest.mark.parametrize("wrap", ["360 degrees", "180 degrees", "two pi"])
def test_row_44_headings_that_wrap(wrap, noted):
    run = make_run(800, phase=0.0, noise=0.0)
    table = frame(run, euler=True)
    # The whole motion turned until its heading passes north and south.
    psi = table["psi"].to_numpy() + np.linspace(0, 8.0, 800)
    rates = np.array(run.nu[:, 3:]) + 8.0 / run.t[-1] * np.stack(
        [-np.sin(table["theta"]), np.sin(table["phi"]) * np.cos(table["theta"]),
         np.cos(table["phi"]) * np.cos(table["theta"])], axis=1,
    )  # fmt: skip
    table = table.with_columns(pl.Series(n, rates[:, i]) for i, n in enumerate("pqr")).drop("x", "y", "z")
    mapping = None
    if wrap == "two pi":
        table = table.with_columns(pl.Series("psi", psi % (2 * np.pi)))
    else:
        degrees = np.degrees(psi)
        degrees = degrees % 360 if wrap == "360 degrees" else (degrees + 180) % 360 - 180
        table = table.with_columns(
            pl.Series("psi", degrees), *(pl.col(n).degrees().alias(n) for n in ("phi", "theta"))
        )
        mapping = {"angles": "deg"}
    assert noted(put(table), mapping, level="error") == ""
    read = Log.read("log.csv", mapping)
    assert np.abs(np.diff(read.runs[0].quaternion, axis=0)).max() < 0.05, "the attitude jumps"
    for name in "pqr":
        assert read.quality().kinematics[name].scale == pytest.approx(1.0, abs=0.02)


def test_row_45_degrees_for_radians_and_radians_for_degrees(refused, noted):
    euler = frame(RUN, euler=True)
    for name in ("phi", "theta", "psi"):
        euler = euler.with_columns(pl.col(name).degrees().alias(name))
    assert "in degrees? Mapping: angles: deg" in refused("check", f"log={put(euler)}")
    deg = 180 / np.pi
    fast = scaled(p=deg, q=deg, r=deg)
    assert "rad/s: in degrees? Mapping: rates: deg" in refused("check", f"log={put(fast)}")
    for mapping, cure in (
        ({"rates": "deg"}, "correct with rates: rad (or angles: deg) in the mapping"),
        ({"angles": "deg"}, "correct with rates: deg (or angles: rad) in the mapping"),
    ):
        found = noted(put(frame(RUN, euler=True)), mapping, level="error")
        assert all(f"error: {name}: {name} is" in found for name in "pqr") and found.count(cure) == 6


FLU = {"v": -1.0, "w": -1.0, "q": -1.0, "r": -1.0}


def test_row_46_another_frame_than_declared(noted, refused):
    """Signs that contradict attitude and position are errors, and such a log is not fitted unless forced."""
    found = noted(put(scaled(**FLU)), level="error")
    for name in FLU:
        assert f"error: {name}: {name} has the opposite sign of the derivative of the" in found
    for verb, more in (("diagnose", []), ("add", ["effect=ocean_current"]), ("train", [])):
        line = refused(verb, "model=four.yaml", "log=log.csv", *more)
        assert (
            "opposite sign" in line
            and "correct with scale: -1 in the mapping" in line
            and "force=true" in line
        )
    assert noted("log.csv", {"columns": {n: {"from": n, "scale": -1} for n in FLU}}, level="error") == ""
    up = frame(RUN).with_columns(-pl.col("z").alias("z")).drop("x", "y")
    assert "above the surface if z points down; frame: {world: ENU}" in noted(put(up), level="warning")


def test_row_47_quaternions_that_are_no_rotation(noted, refused):
    names = ("qw", "qx", "qy", "qz")
    q = np.array(RUN.quaternion)
    q[100:] *= -1
    q[200] *= 0.9
    q[300] = 0.0
    q[400] = np.nan
    table = frame(RUN).with_columns(pl.Series(n, q[:, i]) for i, n in enumerate(names))
    found = noted(put(table))
    assert "no rotation (norm down to 0) read as missing (2)" in found
    assert "sign flips of the quaternion (the same attitude) undone (1)" in found
    read = Log.read("log.csv").runs[0].quaternion
    assert np.flatnonzero(np.isnan(read).any(1)).tolist() == [200, 300, 400]
    np.testing.assert_allclose(np.linalg.norm(read[np.isfinite(read).all(1)], axis=1), 1.0, atol=1e-12)
    small = frame(RUN).with_columns(pl.col(n) * 0.3 for n in names)
    assert "typical norm is 0.3, not 1" in refused("check", f"log={put(small)}")
    turned = frame(RUN).rename(dict(zip(names, ("qx", "qy", "qz", "qw"), strict=True)))
    found = noted(put(turned), level="error")
    assert "error: attitude: the quaternion's parts stand in the order" in found and "in the mapping" in found


def test_row_59_spikes_are_left_out_and_counted(noted):
    from auvnn.metrics.derivative import choose_derivative
    from auvnn.metrics.one_step import accelerations
    from auvnn.metrics.windows import cut_windows
    from auvnn.models import load

    u = np.array(RUN.nu[:, 0])
    u[[100, 300, 500, 700]] += 3.0
    found = noted(put(frame(RUN).with_columns(pl.Series("u", u))), level="warning")
    assert (
        "spikes: single samples that leave their neighbours: u 4 (0.5 %); fits and scores leave them out"
        in found
    )
    run = Log.read("log.csv").runs[0]
    windows = cut_windows(Log.from_runs([run]), 39.0)
    assert np.flatnonzero(windows.mask[0, :780, 6] == 0).tolist() == [100, 300, 500, 700]
    wrench = make_run(800, noise=0.005, thrusters=None, wrench=np.zeros((800, 6)))
    spoilt = Run(1, wrench.t, wrench.quaternion, run.nu, wrench=wrench.wrench)
    how = choose_derivative(Log.from_runs([wrench]), None)
    model = load("rov95", actuation="wrench")
    clean, dirty = (accelerations(model, r, how)[0][:, 0] for r in (wrench, spoilt))
    good = np.isfinite(dirty)
    assert 0.9 < good.mean() < 1.0
    np.testing.assert_allclose(dirty[good], clean[good], atol=1e-9)


def test_row_63_different_vehicles_in_one_data_set(refused):
    put(make_run(100))
    put(make_run(100, phase=1.0, thrusters=np.zeros((100, 6)) + 0.1), "other.csv")
    line = refused("check", "log=[log.csv,other.csv]")
    assert "differ in thrusters (4), thrusters (6): one log holds one vehicle" in line


def test_row_64_the_same_dive_on_both_sides(refused):
    """Under another name, in another format and on another clock."""
    put(RUN)
    frame(RUN).with_columns(pl.col("t") + 1000.0)[200:].write_parquet("held-out.parquet")
    for verb, more in (("add", ["effect=ocean_current"]), ("train", [])):
        line = refused(verb, "model=four.yaml", "log=log.csv", "test=held-out.parquet", *more)
        assert "shares 600 of 600 samples" in line and "hold out another run" in line
