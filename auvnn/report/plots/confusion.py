"""What was hidden against what was answered, counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import label

OUTCOMES = ("ambiguous", "unknown", "adequate", "fault")
RIGHT = {"nothing": "adequate"}
GAP = 0.35  # cells, between names and outcomes
# Ever darker, so that a grey print keeps the order, yet not so dark that the frame is lost.
SHADES = ["#ffffff", "#c9dcec", style.BAR, style.AFTER.color]
# As many rows or columns as the numbers in the cells stay legible for.
MOST = 56
# Below this step of the cells, in inches, names stand upright and smaller.
NARROW = 0.17


@style.styled
def confusion(
    hidden: Sequence[str],
    answered: Sequence[str],
    counts: ArrayLike,
    *,
    outcomes: Sequence[str] = OUTCOMES,
    right: Mapping[str, str] = RIGHT,
) -> Figure:
    """Draw how many logs with this hidden were answered with that; shade: share of the row.

    The right answer of each row is framed. Where something else was answered, the count is bold.

    Args:
        hidden: what the logs hide, n rows.
        answered: what was answered, m columns.
        counts: logs, (n, m).
        outcomes: columns that name no effect, set apart on the right.
        right: the right answer for what is not answered with its own name.

    Raises:
        NoData: there is no log, or more of a kind than fit on a page.
    """
    table = np.asarray(counts, dtype=float)
    n, m = len(hidden), len(answered)
    if not n or not m or table.shape != (n, m) or not np.nansum(table) > 0:
        raise NoData("no log was answered")
    if max(n, m) > MOST:
        raise NoData(f"{n} rows and {m} columns are too many for one figure")
    names = [j for j in range(m) if answered[j] not in outcomes]
    order = names + [j for j in range(m) if answered[j] in outcomes]
    place = {j: k + (GAP if names and k >= len(names) else 0.0) for k, j in enumerate(order)}
    edge = max(place.values()) + 1
    lines = [i + (GAP if hidden[i] in right and i > 0 else 0.0) for i in range(n)]
    step = min(0.36, (style.PAGE - 2.3) / (m + GAP + 1))
    figure = style.new_figure(min(style.PAGE, 2.3 + step * (m + GAP + 1)), 1.75 + min(step, 0.3) * (n + GAP))
    ax = figure.subplots()
    shades = LinearSegmentedColormap.from_list("share", SHADES)
    totals = np.nansum(table, axis=1)
    for i in range(n):
        wanted = right.get(hidden[i], hidden[i])
        for j in range(m):
            share = table[i, j] / totals[i] if totals[i] > 0 else 0.0
            _cell(ax, place[j], lines[i], table[i, j], share, answered[j] == wanted, step, shades)
        ax.text(edge + 0.3, lines[i] + 0.5, f"{totals[i]:.0f}", ha="left", va="center", fontsize=8)
    ax.text(edge + 0.3, -0.1, "logs", ha="left", va="bottom", fontsize=8, style="italic")
    ax.set_xticks([place[j] + 0.5 for j in order], [label(answered[j], 26) for j in order],
                  rotation=55 if step > NARROW else 90, ha="right", rotation_mode="anchor",
                  va="center_baseline" if step <= NARROW else "baseline")  # fmt: skip
    ax.set_yticks([y + 0.5 for y in lines], [label(name, 26) for name in hidden])
    for tick, j in zip(ax.get_xticklabels(), order, strict=True):
        tick.set_fontstyle("italic" if answered[j] in outcomes else "normal")
    for tick, name in zip(ax.get_yticklabels(), hidden, strict=True):
        tick.set_fontstyle("italic" if name in right else "normal")
    ax.set_xlim(-0.05, edge + 0.05)
    ax.set_ylim(max(lines) + 1.05, -0.05)
    ax.tick_params(length=0, labelsize=8 if step > NARROW else 6)
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.set_xlabel("answered first (number of logs)")
    ax.set_ylabel("hidden")
    return figure


def _cell(
    ax: Axes, x: float, y: float, value: float, share: float, is_right: bool, step: float, shades: Colormap
) -> None:
    some = np.isfinite(value) and value > 0
    face = shades(0.08 + 0.92 * share) if some else shades(0.0)
    ax.add_patch(Rectangle((x, y), 1, 1, fc=face, ec="#d0d0d0", lw=0.4, zorder=1))
    if is_right:
        ax.add_patch(Rectangle((x + 0.05, y + 0.05), 0.9, 0.9, fill=False, ec=style.INK, lw=1.3, zorder=3))
    if some or is_right:
        r, g, b, _ = face
        ink = "black" if 0.299 * r + 0.587 * g + 0.114 * b > 0.55 else "white"
        text = f"{value:.0f}" if np.isfinite(value) else "–"
        weight = "normal" if is_right else "bold"
        ax.text(x + 0.5, y + 0.5, text, ha="center", va="center_baseline", color=ink, weight=weight,
                fontsize=8 if step > 0.22 else 6 if step > 0.13 else 5, zorder=4)  # fmt: skip
