"""Rows 33, 34 and 48 to 58: sensors and estimators that mislead."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.metrics.windows import cut_windows
from tests.faults.moving_runs import CLEAN, DT, body, found, read, wandering
from tests.log_samples import frame, make_run


def late(run: Run, rows: int, columns: slice = slice(0, 3)) -> Run:
    """The run with some velocities stamped `rows` samples late; the first rows then have no value."""
    nu = np.array(run.nu)
    nu[:, columns] = np.nan
    at, to = (
        (slice(0, len(nu) - rows), slice(rows, None)) if rows > 0 else (slice(-rows, None), slice(0, rows))
    )
    nu[to, columns] = run.nu[at, columns]
    return Run(1, run.t, run.quaternion, nu, position=run.position, thrusters=run.thrusters)


def test_a_clean_log_gives_none_of_these_findings():
    words = found(Log.from_runs([CLEAN]))
    for subject in (
        "clock",
        "delay",
        "starts again",
        "lever arm",
        "situation",
        "current:",
        "full scale",
        "z:",
        "error",
    ):
        assert subject not in words, words


@pytest.mark.parametrize("offset", [12.4, -7.0])
def test_row_33_a_sensor_with_another_clock(offset):
    log = Log.from_runs([late(wandering(2400), round(offset / DT))])
    (finding,) = [f for f in log.quality().warnings if f.where == "clock"]
    assert finding.what.startswith(
        f"u, v, w are stamped by another clock than attitude and position: {offset:+.2f} s"
    )
    assert float(finding.what.split("correlation ")[1].split()[0]) > 0.95 and "delay" in finding.cure
    low, high = (float(x) for x in finding.what.split("(")[1].split(")")[0].split(" to "))
    assert low <= offset <= high and high - low < 0.1
    corrected = read(log.runs[0], {"columns": {n: {"from": n, "delay": offset} for n in "uvw"}})
    assert "clock" not in found(corrected) and "error" not in found(corrected)


def test_row_33_a_clock_that_runs_too_fast():
    run = wandering(6000)
    skewed = run.t * (1.0 + 2e-3)  # 0.6 s after five minutes
    nu = np.array(run.nu)
    for i in range(3):
        nu[:, i] = np.interp(run.t, skewed, run.nu[:, i])
    log = Log.from_runs([Run(1, run.t, run.quaternion, nu, position=run.position, thrusters=run.thrusters)])
    (finding,) = [f for f in log.quality().warnings if f.where == "clock"]
    assert "drifts against attitude and position" in finding.what
    assert log.quality().kinematics["u"].drift == pytest.approx(2e-3, rel=0.2)


def test_row_34_a_latency_comes_with_an_interval():
    log = Log.from_runs([late(wandering(noise=0.01), 6)])
    for name in "uvw":
        low, high = log.quality().kinematics[name].lag_interval
        assert low <= 0.3 <= high and high - low < 0.1
    assert "velocity sensor +0.30 s (0.2" in found(log) or "velocity sensor +0.30 s (0.30" in found(log)


def test_row_34_the_interval_covers_the_truth():
    """Of independent noisy records at least 17 of 20 intervals hold the true lag (95 % would be 19)."""
    from auvnn.logs.signals.lags import estimate

    hits = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = gaussian_filter1d(rng.normal(size=2005), 6.0)
        pair = (x[5:] + 0.5 * x.std() * rng.normal(size=2000), x[:-5] + 0.5 * x.std() * rng.normal(size=2000))
        lag = estimate([pair], DT)
        hits += lag.low <= 0.25 <= lag.high
        assert abs(lag.value - 0.25) < DT
    assert hits >= 17


def test_row_48_pitch_through_the_vertical():
    """A slow loop: Euler angles flip, the attitude and its rates do not."""
    n = 800
    t = DT * np.arange(n)
    truth = Rotation.from_euler("ZYX", np.stack([0 * t + 0.3, 0.4 * t, 0 * t + 0.02], axis=1))
    rates = (truth[:-1].inv() * truth[1:]).as_rotvec() / DT
    nu = np.concatenate([0.1 * np.sin(t)[:, None] * np.ones((1, 3)), np.vstack([rates, rates[-1:]])], axis=1)
    run = make_run(n, quaternion=truth.as_quat()[:, [3, 0, 1, 2]], nu=nu, position=None)
    log = read(frame(run, euler=True))
    words = found(log)
    passes = int(np.sum(np.diff(np.cos(0.4 * t) < 0) != 0))
    assert "warning: log.csv: samples with a pitch within 5 degrees of the vertical" in words
    assert "repair: log.csv: passes of the vertical, where roll and yaw jump by half a turn" in words
    assert f"carried on as quaternions ({passes})" in words
    got = Rotation.from_quat(log.runs[0].quaternion[:, [1, 2, 3, 0]])
    assert (got.inv() * truth).magnitude().max() < 1e-6
    assert np.abs(np.diff(log.runs[0].quaternion, axis=0)).max() < 0.02, "the attitude jumps"


def jumped(at: int, step: Any = (3.0, -1.0, 0.0), until: int | None = None, turn: float = 0.0) -> Run:
    """The clean run with its position moved, or its heading turned, from one sample on."""
    position, quaternion = np.array(CLEAN.position), np.array(CLEAN.quaternion)
    position[at:until] += np.array(step)
    if turn:
        turned = Rotation.from_euler("Z", turn) * body(CLEAN)[at:]
        quaternion[at:] = turned.as_quat()[:, [3, 0, 1, 2]]
    return Run(1, CLEAN.t, quaternion, CLEAN.nu, position=position, thrusters=CLEAN.thrusters)


def test_row_49_a_reset_of_the_estimate_cuts_the_run():
    assert CLEAN.restarts.tolist() == []
    run = jumped(700)
    assert run.restarts.tolist() == [700]
    assert run.segments() == [slice(0, 700), slice(700, 1600)]
    windows = cut_windows(Log.from_runs([run]), 5.0)
    assert not ((windows.first < 700) & (windows.first + windows.length > 700)).any()
    words = found(Log.from_runs([run]))
    assert "repair: run 1: the pose starts again once (1 by a jump against the velocities" in words
    assert jumped(500, step=(0, 0, 0), turn=0.5).restarts.tolist() == [500], "a heading that is reset"
    assert jumped(700, until=710).restarts.tolist() == [], "a jump that is taken back is a glitch"
    assert jumped(700, step=(0.02, 0, 0)).restarts.tolist() == [], "noise is no reset"


def test_row_49_a_counter_of_resets_is_believed():
    log = read(frame(CLEAN).with_columns(pl.Series("count", np.where(np.arange(1600) < 900, 4, 5))),
               {"columns": {"reset": "count"}})  # fmt: skip
    assert log.runs[0].restarts.tolist() == [900]
    assert "1 by the column reset" in found(log)
    assert log.runs[0].cut(slice(850, 1000)).restarts.tolist() == [50]


def test_row_50_the_core_in_use_is_followed():
    primary = np.where(np.arange(1600) < 1000, 0, 1)
    table = frame(CLEAN)
    wrong = table.with_columns((pl.col(n) + 0.5).alias(n) for n in "uvw")
    wide = table.with_columns(
        pl.Series("PI", primary),
        *(pl.Series(f"{n}_{k}", np.where(primary == k, table[n], wrong[n])) for n in "uvw" for k in (0, 1)),
    ).drop(*"uvw")
    log = read(wide, {"columns": {n: {"from": [f"{n}_0", f"{n}_1"], "by": "PI"} for n in "uvw"}})
    np.testing.assert_allclose(log.runs[0].nu, CLEAN.nu, atol=1e-12)
    assert log.runs[0].restarts.tolist() == [1000]
    assert "repair: log.csv: switches of the estimator's core in use ('PI') followed (1)" in found(log)
    long = pl.concat(
        [
            table.with_columns(pl.Series("PI", primary), pl.lit(0).alias("C"), order=pl.col("t")),
            wrong.with_columns(pl.Series("PI", primary), pl.lit(1).alias("C"), order=pl.col("t") + 1e-6),
        ]
    ).sort("order").drop("order")  # fmt: skip
    log = read(long, {"core": {"column": "C", "primary": "PI"}})
    expected = np.where((primary == 0)[:, None], CLEAN.nu[:, :3], CLEAN.nu[:, :3] + 0.5)
    np.testing.assert_allclose(log.runs[0].nu[:, :3], expected, atol=1e-12)
    assert "rows of other cores than the one in use ('PI') left out (1600)" in found(log)
    with pytest.raises(InputError, match="'PI' says 1: list one column for each core"):
        read(wide, {"columns": {n: {"from": [f"{n}_0"], "by": "PI"} for n in "uvw"}})


@pytest.mark.parametrize(
    ("marks", "rule"),
    [
        (("bottom", "water"), {"is": "bottom"}),
        ((1, 0), {"is": 1}),
        ((0.02, 3.0), {"below": 0.1}),
        ((0.9, 0.0), {"above": 0.5, "below": 2.0}),
    ],
)
def test_row_51_without_bottom_lock_a_doppler_velocity_is_missing(marks, rule):
    lost = (np.arange(1600) >= 300) & (np.arange(1600) < 380)
    nu = np.array(CLEAN.nu)
    nu[lost, :3] = 9.99
    table = frame(Run(1, CLEAN.t, CLEAN.quaternion, nu, position=CLEAN.position, thrusters=CLEAN.thrusters))
    table = table.with_columns(pl.Series("lock", [marks[1] if x else marks[0] for x in lost]))
    mapping = {"columns": {n: {"from": n, "valid": {"from": "lock", **rule}} for n in "uvw"}}
    log = read(table, mapping)
    assert (np.isnan(log.runs[0].nu[:, :3]).all(1) == lost).all()
    assert "repair: log.csv: values of 'u' read as missing where 'lock' is not" in found(log)
    assert log.runs[0].segments() == [slice(0, 300), slice(380, 1600)]


def test_row_51_a_rule_that_cannot_be_is_refused():
    table = frame(CLEAN).with_columns(pl.lit(0).alias("lock"))
    valid = {"from": "lock", "is": 1}
    with pytest.raises(InputError, match="'u' is nowhere valid: 'lock' never is 1"):
        read(table, {"columns": {"u": {"from": "u", "valid": valid}}})
    with pytest.raises(ConfigError, match="asks nothing of 'lock': give is, above or below"):
        read(table, {"columns": {"u": {"from": "u", "valid": {"from": "lock"}}}})
    with pytest.raises(InputError, match=r"'lokc'.*Did you mean 'lock'"):
        read(table, {"columns": {"u": {"from": "u", "valid": {"from": "lokc", "is": 1}}}})


def with_z(z: np.ndarray) -> Log:
    position = np.array(CLEAN.position)
    position[:, 2] = z
    return Log.from_runs(
        [Run(1, CLEAN.t, CLEAN.quaternion, CLEAN.nu, position=position, thrusters=CLEAN.thrusters)]
    )


def test_row_52_a_depth_sensor_inside_the_hull():
    drift = 0.1 + 0.02 * np.sin(0.05 * CLEAN.t) + 0.001 * np.random.default_rng(1).normal(size=1600)
    words = found(with_z(drift), "warning")
    assert "warning: z: z hardly follows the vertical velocity" in words and "inside the hull" in words


def test_row_53_negative_depths_and_heights_that_mean_none():
    z, altitude = np.array(CLEAN.position[:, 2]), np.linspace(5.0, 4.0, 1600)
    gone = np.arange(1600) % 50 == 7
    z[gone], altitude[gone] = -1.0, -1.0
    run = Run(1, CLEAN.t, CLEAN.quaternion, CLEAN.nu, thrusters=CLEAN.thrusters, altitude=altitude,
              position=np.column_stack([CLEAN.position[:, :2], z]))  # fmt: skip
    log = read(run)
    assert (np.isnan(log.runs[0].position[:, 2]) == gone).all() and (
        np.isnan(log.runs[0].altitude) == gone
    ).all()
    words = found(log, "repair")
    assert f"depths of -1 m, which mean none was measured, read as missing ({gone.sum()})" in words
    assert (
        f"negative heights above the bottom, which mean none was measured, read as missing ({gone.sum()})"
        in words
    )
    above = read(frame(CLEAN).with_columns(pl.col("z") - 20.0))
    assert np.isfinite(above.runs[0].position).all(), "a true depth below zero stays"


@pytest.mark.parametrize(
    ("factor", "words", "scale"),
    [
        (0.01, "hPa (mbar) was read as Pa", "100 "),
        (10055.25, "a pressure in Pa", "9.94505e-05"),
        (-1.0, "point up", "-1"),
    ],
)
def test_row_54_pressure_in_another_unit(factor, words, scale):
    log = with_z(factor * CLEAN.position[:, 2])
    text = found(log, "error")
    if factor > 0:
        assert "error: z: z changes" in text and words in text and f"correct with scale: {scale}" in text
        assert "error: w" not in text, "the depth is at fault, not w"
        with pytest.raises(InputError, match="z changes"):
            log.quality().refuse_contradictions()
    else:
        assert "w: w has the opposite sign" in text or words in text
    without = np.array(log.runs[0].position)
    without[:, :2] = np.nan
    run = Run(1, CLEAN.t, CLEAN.quaternion, CLEAN.nu, position=without, thrusters=CLEAN.thrusters)
    assert words in found(Log.from_runs([run]), "error"), "x and y are not needed"


def test_row_55_pulse_widths_that_mean_no_signal(refused):
    pwm = 1500.0 + 400.0 * CLEAN.thrusters
    pwm[100:110, 0], pwm[200:205, 1] = 0.0, 65535.0
    table = frame(CLEAN).with_columns(pl.Series(f"thruster_{i + 1}", pwm[:, i]) for i in range(4))
    curve = {"neutral": 1500, "span": 400}
    log = read(
        table,
        {"columns": {f"thruster_{i + 1}": {"from": f"thruster_{i + 1}", "curve": curve} for i in range(4)}},
    )
    thrusters = log.runs[0].thrusters
    assert np.isnan(thrusters[100:110, 0]).all() and np.isnan(thrusters[200:205, 1]).all()
    assert np.isnan(thrusters).sum() == 15 and np.nanmax(np.abs(thrusters)) <= 1.0
    assert "(0, 65535) read as missing (10)" in found(log) and "(0, 65535) read as missing (5)" in found(log)
    table.write_csv("log.csv")
    assert "are they PWM?" in refused("check", "log=log.csv")


def test_row_57_a_battery_that_runs_down():
    falling = Run(1, CLEAN.t, CLEAN.quaternion, CLEAN.nu, thrusters=CLEAN.thrusters,
                  voltage=np.linspace(16.0, 12.8, 1600))  # fmt: skip
    words = found(Log.from_runs([falling]), "warning")
    assert (
        "voltage: the battery falls from 16 to 12.8 V" in words
        and "consider the effect voltage_droop" in words
    )
    assert "voltage" not in found(Log.from_runs([CLEAN]))


def test_row_58_a_gyro_at_full_scale():
    nu = np.array(CLEAN.nu)
    limit = 0.7 * np.abs(nu[:, 5]).max()
    nu[:, 5] = np.clip(nu[:, 5], -limit, limit)
    run = Run(1, CLEAN.t, CLEAN.quaternion, nu, position=CLEAN.position, thrusters=CLEAN.thrusters)
    log = read(run)
    beyond = np.abs(CLEAN.nu[:, 5]) >= limit
    assert (np.isnan(log.runs[0].nu[:, 5]) == beyond).all()
    words = f"samples of 'r' at full scale ({limit:.4g}) read as missing ({beyond.sum()})"
    assert words in found(log, "warning")
    assert np.isfinite(read(CLEAN).runs[0].nu).all()
