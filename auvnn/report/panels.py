"""Six panels, one per degree of freedom, that several plots share: translation left, rotation right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT, decimate
from auvnn.report.words import label

FARTHEST = 1e100


class NoData(ValueError):
    """There is nothing to draw; the message says what is missing, in words for the page."""


def six_panels(height: float = 5.0, sharex: bool = True) -> tuple[Figure, list[Axes]]:
    """Return a page-wide figure and its six axes in the order of the degrees of freedom."""
    figure = style.new_figure(style.PAGE, height)
    grid = figure.subplots(3, 2, sharex=sharex)
    return figure, [grid[i % 3, i // 3] for i in range(6)]


def columns(values: ArrayLike, name: str) -> np.ndarray:
    """Return values as (N, 6) floats, or say that they are not; what cannot be drawn becomes NaN."""
    values = np.asarray(values, dtype=float)
    if values.ndim != 2 or values.shape[1] != 6:
        raise NoData(f"{name} is not a table of six columns (its shape is {values.shape})")
    # A diverged model overflows the arithmetic of axes long before it overflows a float.
    return np.where(np.abs(values) < FARTHEST, values, np.nan)


def time_series(
    t: ArrayLike,
    lines: Mapping[str, ArrayLike],
    *,
    symbols: Sequence[tuple[str, str]] = style.VELOCITY,
    remarks: Sequence[str] = (),
    title: str = "",
    limit: int = LIMIT,
    reference: bool = True,
) -> Figure:
    """Draw each line's six columns over time.

    Args:
        t: s, (N,).
        lines: name to values (N, 6), at most five; NaN where there is none.
        symbols: symbol and unit of each column.
        remarks: a short text for each panel, for example an error.
        title: above the panels.
        limit: most points drawn of each line.
        reference: the first line is the measurement, shown in full; the others may leave the panel. Without
            one, the lines depart from zero, and the one that departs least is shown in full.
    """
    t = np.asarray(t, dtype=float).ravel()
    tables = {name: columns(values, name) for name, values in lines.items()}
    if not tables or not np.isfinite(t).any():
        raise NoData("there are no samples to draw over time")
    if not any(np.isfinite(table).any() for table in tables.values()):
        raise NoData("every sample is missing")
    figure, axes = six_panels()
    looks = _looks(list(tables), reference)
    handles: list[Any] = []
    for i, (ax, (symbol, unit)) in enumerate(zip(axes, symbols, strict=True)):
        handles = [
            _line(ax, *decimate(t, table[:, i], limit), look, name)
            for (name, table), look in zip(tables.items(), looks, strict=True)
        ]
        ax.set_ylabel(style.axis_label(symbol, unit))
        style.show_grid(ax, "both")
        drawn = [table[:, i] for table in tables.values()]
        if not reference:
            ax.axhline(0, color=style.FAINT, lw=0.6, zorder=1)
            drawn.sort(key=_reach)
        _limit_view(ax, drawn, 1.5 if reference else 4.0)
        if i < len(remarks) and remarks[i]:
            ax.set_title(remarks[i], fontsize=8, loc="right", pad=2, color="#404040")
    for ax in (axes[2], axes[5]):
        ax.set_xlabel(style.axis_label("t", "s"))
    figure.align_ylabels()
    title = label(title, 90)
    # In the order of the story, whatever lies on top.
    if "as given" in tables:
        told = ("measured", "as given", "refitted", "after")
        handles.sort(key=lambda h: told.index(h.get_label()) if h.get_label() in told else len(told))
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), title=title or None)
    return figure


def _looks(names: list[str], reference: bool) -> list[style.Look]:
    spare = iter([style.BEFORE, style.AFTER, style.REFITTED, style.PERSISTENCE, style.PERSISTENCE])
    return [
        style.LOOKS.get(name) or (style.MEASURED if i == 0 and reference else next(spare))
        for i, name in enumerate(names)
    ]


def _line(ax: Axes, t: np.ndarray, y: np.ndarray, look: style.Look, name: str) -> Any:
    return ax.plot(t, y, color=look.color, ls=look.dashes, lw=look.width, label=label(name))[0]


def _reach(line: np.ndarray) -> float:
    good = np.abs(line[np.isfinite(line)])
    return float(good.max()) if good.size else np.inf


def _limit_view(ax: Axes, lines: list[np.ndarray], room: float) -> None:
    """Show the first line in full, and of the others what does not flatten it."""
    ranges = [(float(good.min()), float(good.max())) for y in lines if (good := y[np.isfinite(y)]).size]
    if len(ranges) < 2 or not np.isfinite(lines[0]).any():
        return
    low, high = ranges[0]
    span = max(high - low, 1e-9)
    want_low, want_high = min(r[0] for r in ranges), max(r[1] for r in ranges)
    if want_low >= low - room * span and want_high <= high + room * span:
        return
    bottom, top = max(want_low, low - room * span), min(want_high, high + room * span)
    ax.set_ylim(bottom - 0.05 * (top - bottom), top + 0.05 * (top - bottom))
    ax.set_title("a model leaves the panel", fontsize=8, loc="left", pad=2, style="italic")
