"""Measured against model over time, by degree of freedom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT
from auvnn.report.panels import columns, time_series
from auvnn.report.words import number


@style.styled
def measured_against_model(
    t: ArrayLike,
    measured: ArrayLike,
    model: ArrayLike,
    *,
    symbols: Sequence[tuple[str, str]] = style.VELOCITY,
    title: str = "",
    limit: int = LIMIT,
) -> Figure:
    """Draw six panels, the measurement as a line and the model dashed, each with its rms error.

    Args:
        t: s, (N,).
        measured: (N, 6), NaN where missing.
        model: (N, 6), NaN where the model did not run.
        symbols: symbol and unit of each column: `style.VELOCITY`, `style.ACCELERATION` or `style.WRENCH`.
        title: above the legend, for example the run's number.
        limit: most points drawn of each line (min/max decimation).

    Raises:
        NoData: there is nothing to draw.
    """
    remarks = rms_remarks(measured, {"": model}, symbols)
    lines = {"measured": measured, "model": model}
    return time_series(t, lines, symbols=symbols, remarks=remarks, title=title, limit=limit)


def rms_remarks(
    measured: ArrayLike, models: dict[str, ArrayLike], symbols: Sequence[tuple[str, str]]
) -> list[str]:
    """Return for each column `rms error 0.12 → 0.03 m/s`, in the order of the models.

    Args:
        measured: (N, columns).
        models: predictions by the model's name, (N, columns) each.
        symbols: symbol and unit of each column.
    """
    truth = columns(measured, "measured")
    errors = [rms(columns(model, "model") - truth) for model in models.values()]
    return [
        f"rms error {' → '.join(number(e[i], 2) for e in errors)} {unit}"
        for i, (_, unit) in enumerate(symbols)
    ]


def rms(values: np.ndarray) -> np.ndarray:
    """Return the root mean square of each column over the samples that are there, NaN where there is none."""
    good = np.isfinite(values)
    n = good.sum(axis=0)
    with np.errstate(all="ignore"):
        return np.sqrt(np.square(np.where(good, values, 0.0)).sum(axis=0) / np.where(n > 0, n, np.nan))
