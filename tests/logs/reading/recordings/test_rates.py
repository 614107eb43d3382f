"""Sensors of several rates: the impulse of commands is kept, nothing is invented between samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation, Slerp

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.channels import QUATERNION, VELOCITY
from auvnn.logs.reading.recordings.rates import Series, merge, rows_of
from tests.log_samples import frame, make_run

RUN = make_run(600, dt=0.02)


def held(t: np.ndarray, values: np.ndarray, at: float) -> float:
    return float(values[np.searchsorted(t, at, side="right") - 1])


@pytest.mark.parametrize("rate", [2.0, 7.3, 20.0, 33.0, 100.0])
def test_a_row_gets_the_impulse_of_its_interval(rate: float) -> None:
    """The mean of the held command, against a quadrature that knows nothing of the sums."""
    random = np.random.default_rng(0)
    t = np.arange(0.0, 10.0, 0.1) + 0.02 * random.uniform(size=100)
    told = np.arange(-0.5, 11.0, 1.0 / rate)
    values = random.uniform(-1, 1, (len(told), 1))
    rows = Series(VELOCITY[:3], t, random.normal(size=(100, 3)), "dvl")
    out, _ = merge([rows, Series(("thruster_1",), told, values, "cmd")], rows, "here")
    for k in (0, 3, 50, 98):
        edges = told[(told > t[k]) & (told < t[k + 1])]
        mean = quad(lambda s: held(told, values[:, 0], s), t[k], t[k + 1], points=edges, limit=200)[0] / (
            t[k + 1] - t[k]
        )
        assert out["thruster_1"][k] == pytest.approx(mean, abs=1e-9)


def test_the_same_times_change_nothing() -> None:
    rows = Series(VELOCITY[:3], RUN.t, RUN.nu[:, :3], "a")
    others = [Series(QUATERNION, RUN.t, RUN.quaternion, "b"), Series(VELOCITY[3:], RUN.t, RUN.nu[:, 3:], "c"),
              Series(("thruster_1",), RUN.t, RUN.thrusters[:, :1], "d")]  # fmt: skip
    out, notes = merge([rows, *others], rows, "here")
    np.testing.assert_array_equal(np.stack([out[n] for n in QUATERNION], 1), RUN.quaternion)
    np.testing.assert_array_equal(out["r"], RUN.nu[:, 5])
    np.testing.assert_array_equal(out["thruster_1"], RUN.thrusters[:, 0])
    assert notes == []


def test_the_slower_velocity_sensor_gives_the_rows() -> None:
    slow = Series(VELOCITY[:3], RUN.t[::10], RUN.nu[::10, :3], "dvl")
    fast = Series(VELOCITY[3:], RUN.t, RUN.nu[:, 3:], "imu")
    assert rows_of([fast, slow], None, "here").topic == "dvl"
    assert rows_of([fast, slow], "imu", "here").topic == "imu"
    with pytest.raises(InputError, match="no column of the mapping comes from 'sonar'"):
        rows_of([fast, slow], "sonar", "here")


def test_attitudes_are_interpolated_as_rotations() -> None:
    t = RUN.t[:-1] + 0.007
    rows = Series(VELOCITY[:3], t, RUN.nu[:-1, :3], "dvl")
    out, _ = merge([rows, Series(QUATERNION, RUN.t, RUN.quaternion, "ahrs")], rows, "here")
    q = np.stack([out[n] for n in QUATERNION], axis=1)
    truth = Slerp(RUN.t, Rotation.from_quat(RUN.quaternion[:, [1, 2, 3, 0]]))(t)
    off = Rotation.from_quat(q[:, [1, 2, 3, 0]]) * truth.inv()
    assert off.magnitude().max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)


def test_a_slow_position_stands_where_it_was_measured() -> None:
    rows = Series(VELOCITY[:3], RUN.t, RUN.nu[:, :3], "dvl")
    when = RUN.t[::50] + 0.004
    out, _ = merge([rows, Series(("z",), when, np.arange(12.0)[:, None], "depth")], rows, "here")
    assert np.isfinite(out["z"]).sum() == 12
    np.testing.assert_array_equal(out["z"][::50], np.arange(12.0))


def test_nothing_crosses_a_gap() -> None:
    keep = (RUN.t < 4.0) | (RUN.t > 6.0)
    rows = Series(VELOCITY[:3], RUN.t + 0.005, RUN.nu[:, :3], "dvl")
    out, _ = merge([rows, Series(VELOCITY[3:], RUN.t[keep], RUN.nu[keep, 3:], "imu")], rows, "here")
    inside = (RUN.t > 4.0) & (RUN.t < 5.98)
    assert np.isnan(out["p"][inside]).all() and np.isfinite(out["p"][~inside][:-1]).sum() > 490


def test_old_commands_are_missing_and_counted() -> None:
    rows = Series(VELOCITY[:3], RUN.t, RUN.nu[:, :3], "dvl")
    told = Series(("thruster_1",), np.array([0.0, 0.5, 1.0]), np.ones((3, 1)), "cmd")
    out, notes = merge([rows, told], rows, "here")
    assert np.isnan(out["thruster_1"]).sum() == (RUN.t > 6.0).sum()  # ten of its steps after the last
    assert any("without a command" in n.what for n in notes)
    out, _ = merge([rows, told], rows, "here", longest=60.0)
    assert np.isfinite(out["thruster_1"]).all()


def csv(tmp_path: Path, keep: dict[str, int]) -> Path:
    """Write a table in which some columns are measured in every n-th row alone."""
    table = frame(RUN)
    rows = np.arange(RUN.samples)
    changed = [
        pl.when(pl.Series(rows % n == 0)).then(pl.col(c)).otherwise(None).alias(c) for c, n in keep.items()
    ]
    path = tmp_path / "log.csv"
    table.with_columns(changed).write_csv(path)
    return path


def test_slow_commands_in_a_table_are_held(tmp_path: Path) -> None:
    names = [f"thruster_{i}" for i in range(1, 5)]
    back = Log.read(csv(tmp_path, dict.fromkeys(names, 25))).runs[0]
    assert back.samples == RUN.samples
    np.testing.assert_array_equal(back.nu, RUN.nu)
    np.testing.assert_array_equal(back.thrusters[::25], RUN.thrusters[::25])
    np.testing.assert_array_equal(back.thrusters[13], RUN.thrusters[0])


def test_a_slow_dvl_in_a_table_gives_the_rows(tmp_path: Path) -> None:
    log = Log.read(csv(tmp_path, dict.fromkeys(["u", "v", "w"], 20)))
    back = log.runs[0]
    assert back.samples == RUN.samples // 20
    np.testing.assert_allclose(back.nu, RUN.nu[::20], atol=1e-12)
    np.testing.assert_allclose(back.quaternion, RUN.quaternion[::20], atol=1e-12)
    mean = RUN.thrusters[:580].reshape(29, 20, 4).mean(axis=1)
    np.testing.assert_allclose(back.thrusters[:29], mean, atol=1e-9)
    assert back.valid.all()
    assert any("columns of several rates" in r.what for r in log.repairs)


def test_a_log_without_a_dvl_is_data(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame(RUN).drop(["u", "v", "w", "x", "y"]).write_csv(path)
    log = Log.read(path)
    assert np.isnan(log.runs[0].nu[:, :3]).all() and np.isfinite(log.runs[0].nu[:, 3:]).all()
    assert log.quality().to_dict()["metrics"]["samples"] == RUN.samples
    frame(RUN).select(["t", "x", "y", "z", "thruster_1"]).write_csv(path)
    assert np.isnan(Log.read(path).runs[0].quaternion).all()
    frame(RUN).drop(["u"]).write_csv(path)
    with pytest.raises(InputError, match="column u missing"):
        Log.read(path)
