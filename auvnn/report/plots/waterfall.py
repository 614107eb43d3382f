"""From the model as given down to the noise floor, step by step."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import MINUS, finite, label

FLOOR = "noise floor"
WIDTH = 0.62


@style.styled
def waterfall(steps: Sequence[Mapping[str, Any]], unit: str = "nrmse over 5 s") -> Figure:
    """Draw the error that is left after each step as a bar, and what the step took off hatched above it.

    Args:
        steps: in order, {step: words, error: number or None}; the last may be "noise floor".
        unit: what the error is.

    Raises:
        NoData: fewer than two steps have an error.
    """
    known = [(str(s.get("step", "?")), e) for s in steps if (e := finite(s.get("error"))) is not None]
    if len(known) < 2:
        raise NoData("fewer than two steps have an error")
    figure = style.new_figure(min(style.PAGE, 1.6 + 0.95 * len(known)), 2.9)
    ax = figure.subplots()
    top = max(max(error for _, error in known), 1e-12)
    decimals = max(0, 2 - math.floor(math.log10(top)))
    previous = None
    for i, (name, error) in enumerate(known):
        floor = name == FLOOR
        face, hatch = ("white", "----") if floor else (style.BAR, "")
        ax.bar(i, error, width=WIDTH, fc=face, ec=style.INK, hatch=hatch)
        if previous is not None and not floor and previous != error:
            _change(ax, i, previous, error, decimals)
        _value(ax, i, error, f"{error:.{decimals}f}", face, inside=error > 0.16 * top)
        previous = error
    if known[-1][0] == FLOOR:
        ax.axhline(known[-1][1], color=style.INK, lw=0.7, ls=(0, (4, 2)), zorder=1.5)
    ax.set_xticks(range(len(known)), [_wrapped(name) for name, _ in known], linespacing=0.85)
    ax.tick_params(axis="x", length=0)
    ax.set_ylim(0, 1.14 * top)
    ax.set_ylabel(f"held-out error ({unit})")
    return figure


def _change(ax: Axes, i: int, previous: float, error: float, decimals: int) -> None:
    low, high = sorted((previous, error))
    look = style.AFTER if error < previous else style.BEFORE
    ax.bar(i, high - low, bottom=low, width=WIDTH, fc="white", ec=look.color, hatch=look.hatch, lw=0.8)
    ax.plot([i - 1 + WIDTH / 2, i - WIDTH / 2], [previous, previous], color=style.INK, lw=0.6)
    size = f"{high - low:.{decimals}f}"
    # A step that rounds to nothing says so without a sign.
    text = f"{MINUS if error < previous else '+'}{size}" if float(size) else f"< {10.0**-decimals:g}"
    place = {"xytext": (0, 2), "textcoords": "offset points", "ha": "center", "va": "bottom"}
    ax.annotate(text, (i, high), fontsize=8, color=look.color, **place)


def _value(ax: Axes, i: int, error: float, text: str, face: str, inside: bool) -> None:
    # The box keeps the hatch and the dashed floor from running through the figure.
    box = {"fc": face if inside else "white", "ec": "none", "pad": 0.6}
    place = {"xytext": (0, -4 if inside else 3), "textcoords": "offset points", "ha": "center"}
    ax.annotate(text, (i, error), va="top" if inside else "bottom", weight="bold", bbox=box, **place)


def _wrapped(name: str) -> str:
    """Break a name at blanks and underscores into lines of about fourteen letters."""
    lines = [""]
    for part in re.findall(r"[^_ ]*[_ ]?", label(name, 40)):
        if lines[-1] and len(lines[-1]) + len(part.strip()) > 15:
            lines.append("")
        lines[-1] += part
    return "\n".join(line.strip() for line in lines)
