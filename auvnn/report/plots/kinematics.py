"""Does what the sensors say agree with itself: rates against attitude, velocity against position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import MINUS, finite, label

TOLERANCE = 0.2


@style.styled
def kinematics(checks: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the slope of each measured velocity on what the attitude or the position implies.

    A slope of one is right, minus one a reversed axis. The bar's fill says how far to believe it: the
    correlation is written beside it.

    Args:
        checks: {channel, slope, correlation, std (optional, of the slope)}, all without unit.

    Raises:
        NoData: no channel has a slope.
    """
    known = [(c, s) for c in checks if (s := finite(c.get("slope"))) is not None]
    if not known:
        raise NoData("no channel could be checked against another")
    figure = style.new_figure(style.COLUMN * 1.4, 0.75 + 0.27 * len(known))
    ax = figure.subplots()
    shown = [min(max(slope, -3.0), 3.0) for _, slope in known]
    for i, ((check, slope), drawn) in enumerate(zip(known, shown, strict=True)):
        right = abs(slope - 1) <= TOLERANCE
        look = style.AFTER if right else style.BEFORE
        std = finite(check.get("std"))
        ax.barh(
            i,
            drawn,
            height=0.62,
            fc=style.BAR if right else "#f3c9a8",
            ec=look.color,
            hatch="" if right else look.hatch,
            xerr=std,
            error_kw={"lw": 0.8, "capsize": 2},
        )
        correlation = finite(check.get("correlation"))
        words = "" if correlation is None else f"correlation {correlation:.2f}"
        ax.text(
            1.02,
            i,
            f"{slope:.2f}   {words}".replace("-", MINUS),
            va="center",
            fontsize=8,
            transform=ax.get_yaxis_transform(),
            weight="normal" if right else "bold",
        )
    ax.axvline(0, color=style.INK, lw=0.6)
    ax.axvline(1, color=style.INK, lw=0.8, ls=(0, (4, 2)))
    low, high = min(0.0, *shown), max(1.0, *shown)
    ax.set_xlim(low - 0.15, high + 0.15)
    ax.set_ylim(len(known) - 0.4, -0.6)
    ax.set_yticks(range(len(known)), [label(c.get("channel", "?"), 18) for c, _ in known], style="italic")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("slope, measured on implied (1 = right, dashed)")
    return figure
