"""Parameters over dives: each value with its 95 % interval, the mean of all, and the line through them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label, p_value

MOST, TALL = 12, 1.45  # panels, and inches of each
Z95 = 1.96


@style.styled
def over_dives(
    dives: Sequence[Mapping[str, Any]], trends: Sequence[Mapping[str, Any]], along: str, since: str = ""
) -> Figure:
    """Draw one panel for each parameter, dives from left to right.

    Dives that leave something unexplained are hollow: their values may stand in for something else.

    Args:
        dives: {dive, days, verdict, parameters: {effect: {parameter: {value, std}}}}.
        trends: {effect, parameter, unit, mean, slope, line, changes, constancy}, one for each panel.
        along: "date" or "dive".
        since: date of the first dive, for the axis.

    Raises:
        NoData: no dive has a value.
    """
    panels = [(row, points) for row in trends[:MOST] if (points := _points(dives, row, along))]
    if not panels:
        raise NoData("no dive has a value with a standard error")
    figure = style.new_figure(style.PAGE * 0.86, 0.75 + TALL * len(panels))
    grid = figure.subplots(len(panels), 1, squeeze=False, sharex=True)
    handles: dict[str, Any] = {}
    for ax, (row, points) in zip(grid[:, 0], panels, strict=True):
        _panel(ax, row, points, handles)
    last = grid[-1, 0]
    if along == "date":
        last.set_xlabel(f"days since {since[:10]}" if since else "days since the first dive")
    else:
        last.set_xlabel("dive")
        last.xaxis.get_major_locator().set_params(integer=True)
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=len(handles))
    return figure


# x, value, standard deviation, whether nothing is left unexplained.
Point = tuple[float, float, float, bool]


def _points(dives: Sequence[Mapping[str, Any]], row: Mapping[str, Any], along: str) -> list[Point]:
    found = []
    for dive in dives:
        entry = (dive.get("parameters") or {}).get(row.get("effect"), {}).get(row.get("parameter"), {})
        x = finite(dive.get("days" if along == "date" else "dive"))
        value, std = finite(entry.get("value")), finite(entry.get("std"))
        if x is not None and value is not None and std is not None:
            found.append((x, value, std, dive.get("verdict") == "adequate"))
    return found


def _panel(ax: Axes, row: Mapping[str, Any], points: list[Point], handles: dict[str, Any]) -> None:
    for adequate, words in ((True, "dive, 95 % interval"), (False, "dive with more unexplained")):
        some = [p for p in points if p[3] is adequate]
        if some:
            x, y, s = (np.array([p[k] for p in some]) for k in range(3))
            drawn = ax.errorbar(x, y, yerr=Z95 * s, fmt="o" if adequate else "^", color=style.INK, capsize=2.2,
                                lw=0.9, ms=4, mfc=style.INK if adequate else "white", zorder=3)  # fmt: skip
            handles.setdefault(words, drawn)
    x = np.array([p[0] for p in points])
    line, slope = row.get("line") or {}, row.get("slope") or {}
    mean = finite((row.get("mean") or {}).get("value"))
    if mean is not None:
        drawn = ax.axhline(mean, color=style.PERSISTENCE.color, ls=style.PERSISTENCE.dashes, lw=1.1, zorder=1)
        handles.setdefault("weighted mean", drawn)
    level, steep = finite(line.get("level")), finite(slope.get("value"))
    if level is not None and steep is not None:
        at = np.linspace(x.min(), x.max(), 60)
        away = at - float(line["middle"])
        half = Z95 * np.hypot(finite(line.get("std")) or 0.0, away * (finite(slope.get("std")) or 0.0))
        band = ax.fill_between(at, level + steep * away - half, level + steep * away + half, fc=style.SHADE, ec="none",
                               zorder=0)  # fmt: skip
        drawn = ax.plot(
            at, level + steep * away, color=style.AFTER.color, ls=style.AFTER.dashes, lw=1.2, zorder=2
        )[0]
        handles.setdefault("line, 95 % band", (band, drawn))
    unit = str(row.get("unit") or "1")
    ax.set_ylabel("dimensionless" if unit == "1" else label(unit, 12))
    changes = "changes" if row.get("changes") else "no change seen"
    p = p_value((row.get("constancy") or {}).get("p_value"))
    words = (
        f"{label(row.get('effect'), 30)}  {label(row.get('parameter'), 20)}: {changes} (constant: p = {p})"
    )
    ax.set_title(words.replace("p = <", "p <"), loc="left", fontsize=8, pad=3)
    ax.margins(x=0.04, y=0.12)
    style.show_grid(ax)
