"""Runs whose positions and velocities belong together, and what check says about a log."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from auvnn.logs import Log, Run
from tests.log_samples import frame, make_run

DT = 0.05


def body(run: Run) -> Rotation:
    return Rotation.from_quat(run.quaternion[:, [1, 2, 3, 0]])


def wandering(n: int = 1600, seed: int = 0, noise: float = 0.003, **changes: Any) -> Run:
    """A run whose position never repeats: smoothed random velocities, integrated; body velocities belong to it."""
    rng = np.random.default_rng(seed)
    run = make_run(n, noise=0.0)
    speed = gaussian_filter1d(rng.normal(size=(n + 1, 3)), 0.8 / DT, axis=0)
    speed *= np.array([0.4, 0.3, 0.2]) / speed.std(0)
    middle = 0.5 * (speed[1:] + speed[:-1])
    position = np.cumsum(np.concatenate([[[0.0, 0.0, 3.0]], DT * middle[:-1]]), axis=0)
    position[:, 2] += 3.0 - position[:, 2].min()
    nu = np.concatenate([body(run).inv().apply(speed[:n]), run.nu[:, 3:]], axis=1)
    values: dict[str, Any] = {
        "nu": nu + noise * rng.normal(size=nu.shape),
        "position": position + 0.2 * noise * rng.normal(size=position.shape),
    }
    return make_run(n, **(values | changes))


def read(table: pl.DataFrame | Run, mapping: Any = None) -> Log:
    """Write a log's file, read it back."""
    (frame(table) if isinstance(table, Run) else table).write_csv("log.csv")
    return Log.read("log.csv", mapping)


def found(log: Log, level: str | None = None) -> str:
    return "\n".join(
        f"{f.level}: {f.where}: {f.what}; {f.cure}"
        for f in log.quality().findings
        if level in (None, f.level)
    )


CLEAN = wandering()
