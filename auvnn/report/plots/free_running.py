"""The plant's velocity and those of models that run free, as the paper's figures 5 to 9 draw them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData, time_series
from auvnn.report.plots.measured_against_model import rms_remarks
from auvnn.report.words import label, number

# Ranges of the measurement: a model that errs by more in every panel would only flatten what else there is to see.
FAR = 1.5


@style.styled
def free_running(
    t: ArrayLike, lines: Mapping[str, ArrayLike], *, mark: float | None = None, mark_words: str = ""
) -> Figure:
    """Draw six panels: the plant as a line, the models dashed, each panel with their rms errors in order.

    Args:
        t: s, (N,).
        lines: the plant first, then at most three models: name to velocity (N, 6).
        mark: a time to be marked, s.
        mark_words: what happens then.

    Raises:
        NoData: there is no plant, or no model.
    """
    if len(lines) < 2:
        raise NoData("there is no model to hold against the plant")
    plant, *models = lines
    lines, gone = _held(lines)
    drawn = {name: lines[name] for name in models if name not in gone}
    remarks = rms_remarks(lines[plant], drawn, style.VELOCITY)
    figure = time_series(t, {n: v for n, v in lines.items() if n not in gone}, remarks=remarks)
    if gone:
        said = ", ".join(f"{label(name)} errs by up to {_times(lines, name)}" for name in gone)
        figure.text(0.5, 0.0, f"Not drawn: {said} times the range of the {label(plant)}.", ha="center", va="bottom",
                    fontsize=8, color="#404040")  # fmt: skip
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.set(rect=(0, 0.04, 1, 0.96))  # type: ignore[call-arg]
    if mark is not None:
        for i, ax in enumerate(figure.axes):
            ax.axvline(mark, color=style.FAINT, lw=0.8, ls=(0, (1, 1.5)), zorder=0.5)
            if i == 0:
                ax.annotate(
                    label(mark_words), (mark, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2),
                    textcoords="offset points", fontsize=7, va="top", color="#505050",
                    bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.6}, zorder=5,
                )  # fmt: skip
    return figure


def _held(lines: Mapping[str, ArrayLike]) -> tuple[Mapping[str, ArrayLike], list[str]]:
    """Return the lines, and those that leave every panel, where others are left to draw."""
    names = list(lines)
    gone = [n for n in names[1:] if _least(lines, n) > FAR]
    return lines, gone if len(gone) < len(names) - 1 else []


def _ratios(lines: Mapping[str, ArrayLike], name: str) -> np.ndarray:
    """Return the largest error of a model in each column, in ranges of the first line; NaN where that rests."""
    truth = np.asarray(next(iter(lines.values())), dtype=float)
    error = np.abs(np.asarray(lines[name], dtype=float) - truth)
    with np.errstate(invalid="ignore", divide="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        span = np.nanmax(truth, axis=0) - np.nanmin(truth, axis=0)
        return np.where(span > 1e-9, np.nanmax(error, axis=0) / span, np.nan)


def _least(lines: Mapping[str, ArrayLike], name: str) -> float:
    found = _ratios(lines, name)
    return float(np.nanmin(found)) if np.isfinite(found).any() else 0.0


def _times(lines: Mapping[str, ArrayLike], name: str) -> str:
    return number(float(np.nanmax(_ratios(lines, name))), 2)
