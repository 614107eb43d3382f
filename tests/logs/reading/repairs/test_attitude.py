"""Recorded attitudes: made unit and continuous, masked where they are none, refused where they cannot be."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.reading.repairs.attitude import from_angles, from_quaternions
from tests.log_samples import angles, frame, make_run

RUN = make_run(400)


def found(repairs: list) -> dict[str, int]:
    return {r.what.split(" (")[0]: r.count for r in repairs}


def test_unit_quaternions_are_left_to_the_last_bit() -> None:
    q, repairs = from_quaternions(np.array(RUN.quaternion), "here")
    np.testing.assert_array_equal(q, RUN.quaternion)
    assert repairs == []


def test_interpolated_sign_flips_are_masked_and_flips_undone() -> None:
    raw = np.array(RUN.quaternion)
    raw[200:] *= -1.0
    raw[200] = 0.03 * raw[200]
    raw[100] = 0.96 * raw[100]
    q, repairs = from_quaternions(raw, "here")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(q[:, 0])), [100, 200])
    keep = np.isfinite(q[:, 0])
    np.testing.assert_allclose(q[keep], RUN.quaternion[keep], atol=1e-15)
    assert found(repairs)["quaternions that are no rotation"] == 2
    assert found(repairs)["sign flips of the quaternion"] == 1


def test_rounded_and_scaled_quaternions_are_normalised() -> None:
    q, repairs = from_quaternions(np.round(RUN.quaternion, 4), "here")
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-14)
    assert "quaternions scaled to unit length" in found(repairs)
    q, repairs = from_quaternions(0.9 * RUN.quaternion, "here")
    np.testing.assert_allclose(q, RUN.quaternion, atol=1e-14)
    assert repairs[0].level == "warning"


def test_what_is_no_attitude_is_refused() -> None:
    with pytest.raises(InputError, match=r"typical norm is 0\.4"):
        from_quaternions(0.4 * RUN.quaternion, "here")
    with pytest.raises(InputError, match="this is no attitude"):
        from_quaternions(np.random.default_rng(0).normal(size=(400, 4)), "here")
    with pytest.raises(InputError, match="typical norm is 0"):
        from_quaternions(np.zeros((400, 4)), "here")


def test_more_than_half_missing_is_refused(tmp_path: Path) -> None:
    table = frame(RUN)
    path = tmp_path / "log.parquet"
    values = np.array(RUN.quaternion[:, 1])
    values[:210] = np.nan
    table.with_columns(pl.Series("qx", values)).write_parquet(path)
    with pytest.raises(InputError, match="52 % of the required channel 'attitude' is missing"):
        Log.read(path)
    values = np.array(RUN.nu[:, 2])
    values[:190] = np.nan
    table.with_columns(pl.Series("w", values)).write_parquet(path)
    assert Log.read(path).runs[0].valid.sum() == 210


def test_angles_become_the_same_attitude_through_every_wrap(tmp_path: Path) -> None:
    t = 0.05 * np.arange(2000)
    euler = angles(t)[0]
    euler[:, 2] = 0.3 * t  # several turns
    truth = Rotation.from_euler("ZYX", euler[:, ::-1])
    rate = np.full(2000, 0.3)
    for wrapped in (
        euler,
        np.column_stack([euler[:, :2], np.mod(euler[:, 2], 2 * np.pi)]),
        np.column_stack([euler[:, :2], np.mod(euler[:, 2] + np.pi, 2 * np.pi) - np.pi]),
    ):
        q, _ = from_angles(wrapped, t, rate, "here")
        error = (Rotation.from_quat(q[:, [1, 2, 3, 0]]) * truth.inv()).magnitude()
        assert error.max() < 1e-7
        assert (q[1:] * q[:-1]).sum(axis=1).min() > 0.99


def test_degrees_are_refused_with_the_key_to_set() -> None:
    t = 0.05 * np.arange(2000)
    euler, _ = angles(t)
    rate = make_run(2000).nu[:, 5]
    with pytest.raises(InputError, match="angles: deg"):
        from_angles(np.degrees(euler), t, rate, "here")
    # Only the heading is large: a compass in degrees, with roll and pitch near zero.
    heading = np.stack([0 * t, 0 * t, np.mod(np.degrees(0.2 * t), 360.0)], axis=1)
    with pytest.raises(InputError, match="psi reaches 359"):
        from_angles(heading, t, np.full(2000, 0.2), "here")
    # The same in radians, unwrapped over many turns, is no mistake.
    q, _ = from_angles(np.stack([0 * t, 0 * t, 0.2 * t], axis=1), t, np.full(2000, 0.2), "here")
    assert np.isfinite(q).all()


def test_pitch_through_the_vertical_is_a_warning() -> None:
    t = 0.05 * np.arange(400)
    theta = np.linspace(0.0, np.pi, 400)
    raw = np.stack([np.zeros(400), theta, np.zeros(400)], axis=1)
    q, repairs = from_angles(raw, t, np.zeros(400), "here")
    truth = Rotation.from_rotvec(np.outer(theta, [0.0, 1.0, 0.0]))
    assert (Rotation.from_quat(q[:, [1, 2, 3, 0]]) * truth.inv()).magnitude().max() < 1e-7
    assert repairs[0].level == "warning"
    assert "vertical" in repairs[0].what


def test_units_that_no_vehicle_reaches_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    frame(RUN).with_columns(pl.col("p", "q", "r") * (180 / np.pi)).write_parquet(path)
    with pytest.raises(InputError, match="rates: deg"):
        Log.read(path)
    frame(RUN).with_columns(pl.col("u") * 1000).write_parquet(path)
    with pytest.raises(InputError, match=r"in mm/s\? .*scale: 0.001"):
        Log.read(path)


def test_a_rare_absurd_sample_is_masked_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    values = np.array(RUN.nu[:, 0])
    values[[5, 9]] = [1e300, -1e7]
    frame(RUN).with_columns(pl.Series("u", values)).write_parquet(path)
    log = Log.read(path)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(log.runs[0].nu[:, 0])), [5, 9])
    (repair,) = log.repairs
    assert repair.count == 2
    assert repair.level == "warning"
