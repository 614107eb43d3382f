"""Which candidates leave the same mark on this log."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import label

ALIKE = 0.9


@style.styled
def similarity(
    names: Sequence[str], table: ArrayLike, *, alike: float = ALIKE, cmap: str = "cividis"
) -> Figure:
    """Draw the similarity of every two candidates, 0 (told apart) to 1 (the same), neighbours side by side.

    Args:
        names: of the candidates, n.
        table: (n, n), symmetric; the magnitude counts; the first stays first.
        alike: from here on a cell is framed.
        cmap: a map of steadily rising luminance.

    Raises:
        NoData: fewer than two candidates.
    """
    values = np.abs(np.asarray(table, dtype=float))
    n = len(names)
    if n < 2 or values.shape != (n, n):
        raise NoData("there are not two candidates to compare")
    order = chain(values)
    values = values[np.ix_(order, order)]
    size = min(style.PAGE, 2.0 + 0.27 * n)
    figure = style.new_figure(size, size * 0.86)
    ax = figure.subplots()
    lower = np.ma.masked_where(~np.isfinite(values) | (np.arange(n)[None, :] > np.arange(n)[:, None]), values)
    mesh = ax.pcolormesh(lower, vmin=0, vmax=1, cmap=cmap, edgecolors="white", linewidth=0.5)
    for i in range(n):
        for j in range(i):
            if np.isfinite(values[i, j]) and n <= 20:
                r, g, b, _ = mpl.colormaps[cmap](values[i, j])
                ink = "black" if 0.299 * r + 0.587 * g + 0.114 * b > 0.55 else "white"
                text = "1" if values[i, j] > 0.995 else f"{values[i, j]:.2f}"[1:]
                ax.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=6.5, color=ink)
            if values[i, j] >= alike:
                ax.add_patch(
                    Rectangle((j + 0.04, i + 0.04), 0.92, 0.92, fill=False, ec="black", lw=1.3, zorder=4)
                )
    ticks = [label(names[k], 26) for k in order]
    ax.set_xticks(np.arange(n) + 0.5, ticks, rotation=55, ha="right", rotation_mode="anchor")
    ax.set_yticks(np.arange(n) + 0.5, ticks)
    ax.set_ylim(n, 0)
    ax.tick_params(length=0, labelsize=7.5)
    for spine in ax.spines.values():
        spine.set_visible(False)
    # Beside few candidates the bar is short, and so must be the lines of its label.
    small = n < 12
    words = f"similarity of the residual{chr(10) if small else ' '}(framed: ≥ {alike:g})"
    figure.colorbar(mesh, ax=ax, shrink=1.0 if small else 0.6, aspect=15 if small else 25, label=words)
    return figure


def chain(values: np.ndarray) -> list[int]:
    """Return an order, from the first on, in which each candidate precedes the one most like it."""
    left = set(range(len(values)))
    table = np.nan_to_num(values, nan=0.0) - 2.0 * np.eye(len(values))
    order = [0]
    left.remove(0)
    while left:
        rest = sorted(left)
        order.append(rest[int(np.argmax(table[order[-1], rest]))])
        left.remove(order[-1])
    return order
