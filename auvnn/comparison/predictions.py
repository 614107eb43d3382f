"""Predictions and what was measured: as one trace of a run, and as a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from auvnn.comparison.locate import AXES
from auvnn.metrics.rollouts import NAMES, Rolled

Array = NDArray[np.float64]


def stitch(rolled: Rolled, number: int, nu: Array) -> Array:
    """Return the predictions of every other window (they overlap by half) as one trace of a run, (N, 6).

    Args:
        rolled: free runs over the windows of one horizon.
        number: of the run whose trace is asked for.
        nu: measured velocity of that run, (N, 6), m/s and rad/s; gives the trace its shape alone.
    """
    trace = np.full_like(nu, np.nan)
    upto = -1
    for b in np.flatnonzero(rolled.windows.run == number):
        first, length = int(rolled.windows.first[b]), int(rolled.windows.length[b])
        if first < upto:
            continue
        trace[first : first + length] = rolled.predicted[b, :length]
        upto = first + length - 1
    return trace


class RunTraces(TypedDict):
    """A run's traces, T rows: velocity and acceleration, measured and of the model, and the residual wrench."""

    run: int
    t: Array
    measured: Array
    model: Array
    measured_acc: Array
    model_acc: Array
    residual: Array


class BeforeAfterTraces(TypedDict):
    """A held-out run's velocities, (T, 6): measured, and of the model before and after."""

    run: int
    t: Array
    measured: Array
    before: Array
    after: Array


class RefittedTraces(BeforeAfterTraces):
    """The same, with the model whose uncertain coefficients were refitted and nothing was added."""

    refitted: Array


def write_predictions(series: list[RunTraces] | Mapping[str, list[RunTraces]], path: Path) -> Path:
    """Write measured and predicted velocities and accelerations and the residual wrench as one Parquet table.

    Args:
        series: of one model, or of several by their labels, which become a first column `model`.
        path: of the table.
    """
    import os

    import polars as pl

    frames = []
    for label, runs in series.items() if isinstance(series, Mapping) else ((None, series),):
        for s in runs:
            columns: dict[str, Any] = {} if label is None else {"model": [label] * len(s["t"])}
            columns |= {"run": np.full(len(s["t"]), s["run"]), "t": s["t"]}
            for key, names, suffix in (
                ("measured", NAMES, ""),
                ("model", NAMES, "_model"),
                ("measured_acc", [f"d{n}" for n in NAMES], ""),
                ("model_acc", [f"d{n}" for n in NAMES], "_model"),
                ("residual", AXES, "_residual"),
            ):
                columns.update({f"{n}{suffix}": s[key][:, k] for k, n in enumerate(names)})
            frames.append(pl.DataFrame(columns))
    if not frames:
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.part")
    pl.concat(frames).fill_nan(None).write_parquet(beside)
    os.replace(beside, path)
    return path
