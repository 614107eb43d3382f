"""Logs whose truth is known from formulas that share nothing with the code under test."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from auvnn.logs import Log, Run

NAMES = ("u", "v", "w", "p", "q", "r")


def angles(t: np.ndarray, phase: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return roll, pitch, yaw (N, 3) of a lively motion, and their derivatives."""
    a, w = np.array([0.4, 0.3, 1.2]), np.array([0.9, 0.7, 0.5])
    s = w * t[:, None] + phase + np.array([0.0, 1.0, 2.0])
    return a * np.sin(s), a * w * np.cos(s)


def positions(t: np.ndarray, phase: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return north, east, down (N, 3) and their derivatives."""
    a, w = np.array([1.5, 1.0, 0.4]), np.array([0.4, 0.6, 0.8])
    s = w * t[:, None] + phase
    return a * np.sin(s) + np.array([0.0, 0.0, 2.0]), a * w * np.cos(s)


def make_run(
    n: int = 800,
    dt: float = 0.05,
    number: int = 1,
    phase: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    **changes: Any,
) -> Run:
    """Return a run whose rates, attitude, velocity and position belong to one motion."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    euler, euler_dot = angles(t, phase)
    position, velocity = positions(t, phase)
    rotation = Rotation.from_euler("ZYX", euler[:, ::-1])
    xyzw = rotation.as_quat()
    (phi, theta, _), (dphi, dtheta, dpsi) = euler.T, euler_dot.T
    rates = np.stack(
        [
            dphi - dpsi * np.sin(theta),
            dtheta * np.cos(phi) + dpsi * np.cos(theta) * np.sin(phi),
            -dtheta * np.sin(phi) + dpsi * np.cos(theta) * np.cos(phi),
        ],
        axis=1,
    )
    nu = np.concatenate([rotation.inv().apply(velocity), rates], axis=1)
    values: dict[str, Any] = {
        "number": number,
        "t": t,
        "quaternion": xyzw[:, [3, 0, 1, 2]],
        "nu": nu + noise * rng.normal(size=nu.shape),
        "position": position + 0.2 * noise * rng.normal(size=position.shape),
        "thrusters": 0.8 * np.sin(np.outer(t, [0.3, 0.5, 0.7, 1.1]) + phase),
        "voltage": 16.0 - 0.001 * t + 0.01 * rng.normal(size=n),
    }
    return Run(**(values | changes))


def make_log(runs: int = 2, **changes: Any) -> Log:
    """Return a log of runs that differ in phase."""
    return Log.from_runs([make_run(number=k + 1, phase=0.7 * k, seed=k, **changes) for k in range(runs)])


def frame(run: Run, euler: bool = False) -> pl.DataFrame:
    """Return a run as a table with canonical columns, in radians."""
    columns = dict(run.columns())
    if euler:
        for name in ("qw", "qx", "qy", "qz"):
            del columns[name]
        wxyz = run.quaternion
        turned = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
        columns |= dict(zip(("phi", "theta", "psi"), turned.T, strict=True))
    return pl.DataFrame({name: np.array(column) for name, column in columns.items()})


def same(a: Run, b: Run, tolerance: float = 0.0) -> None:
    """Assert that two runs hold the same samples."""
    left, right = dict(a.columns()), dict(b.columns())
    assert list(left) == list(right)
    for name in left:
        np.testing.assert_allclose(left[name], right[name], rtol=tolerance, atol=tolerance, err_msg=name)
