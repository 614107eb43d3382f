"""The fitted parameters with their 95 % intervals, each kind of unit on a separate axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, interval, label

# Words, value, standard deviation, true value, null.
Row = tuple[str, float, float | None, float | None, float | None]
TRUE: dict[str, Any] = {"marker": "|", "ms": 11, "mew": 1.8, "color": style.INK, "ls": "none"}


@style.styled
def parameters(
    fitted: Mapping[str, Mapping[str, Mapping[str, Any]]],
    truth: Mapping[str, Mapping[str, float]] | None = None,
) -> Figure:
    """Draw each parameter as a point with its 95 % interval (1.96 standard deviations).

    Args:
        fitted: {effect: {parameter: {value, std, unit, null (optional: where it has no effect)}}}.
        truth: {effect: {parameter: value}} where it is known, drawn as an upright stroke.

    Raises:
        NoData: no parameter has a value.
    """
    groups: dict[str, list[Row]] = {}
    for effect, members in fitted.items():
        for name, entry in members.items():
            value = finite(entry.get("value"))
            if value is not None:
                words = f"{label(effect, 22)}  {label(name, 16)}"
                real, null = finite((truth or {}).get(effect, {}).get(name)), finite(entry.get("null"))
                row = (words, value, finite(entry.get("std")), real, null)
                groups.setdefault(str(entry.get("unit") or "1"), []).append(row)
    if not groups:
        raise NoData("no parameter has a value")
    sizes = [len(rows) for rows in groups.values()]
    figure = style.new_figure(style.PAGE * 0.8, 0.3 + sum(0.48 + 0.24 * n for n in sizes))
    grid = figure.subplots(len(groups), 1, squeeze=False, height_ratios=[n + 0.6 for n in sizes])
    for ax, (unit, rows) in zip(grid[:, 0], groups.items(), strict=True):
        _panel(ax, unit, rows)
    if any(row[3] is not None for rows in groups.values() for row in rows):
        figure.legend([grid[0, 0].plot([], [], **TRUE)[0]], ["true value"], loc="outside upper right")
    return figure


def _panel(ax: Axes, unit: str, rows: list[Row]) -> None:
    ink = style.AFTER.color
    for i, (_, value, std, real, null) in enumerate(rows):
        bar = 1.96 * std if std else None
        ax.errorbar(value, i, xerr=bar, fmt="s", color=ink, capsize=2.5, mfc=ink if bar else "white")
        if real is not None:
            ax.plot(real, i, zorder=4, **TRUE)
        # Where a parameter has no effect: zero, if nothing else is said, except for a factor.
        null = 0.0 if null is None and unit != "1" else null
        if null is not None:
            ax.plot([null, null], [i - 0.42, i + 0.42], color=style.FAINT, lw=1, ls=(0, (2, 1.2)), zorder=1)
        right = ax.get_yaxis_transform()
        ax.text(1.02, i, interval(value, std, label(unit, 12)), va="center", fontsize=8, transform=right)
    ax.set_yticks(range(len(rows)), [row[0] for row in rows])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.margins(x=0.08)
    ax.set_xlabel("value (dimensionless)" if unit == "1" else f"value ({label(unit)})", labelpad=1)
    style.show_grid(ax, "x")
