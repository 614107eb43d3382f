"""How much of the fall of the held-out error that the truth gives is reached with what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.plots.recovery import ALL, look_of, sizes_of
from auvnn.report.words import label, prose

LOW, HIGH = -25.0, 125.0  # %: what lies beyond is drawn at the edge
STEP, TALLEST = 0.2, 9.5  # inches


@style.styled
def falls(shares: Mapping[str, Mapping[str, Sequence[float]]], *, target: float | None = None) -> Figure:
    """Draw each log's share of the true fall, by effect and size, with each effect's median.

    Args:
        shares: {effect: {size: shares of the logs}}.
        target: what the median of all is to reach, drawn as an upright line.

    Raises:
        NoData: there is no share at all.
    """
    rows = {e: {s: np.asarray(v, dtype=float) for s, v in by.items() if len(v)} for e, by in shares.items()}
    rows = {e: by for e, by in rows.items() if by}
    if not rows:
        raise NoData("no model was compared on runs that were held out")
    medians = {e: float(np.median(np.concatenate(list(by.values())))) for e, by in rows.items()}
    if len(rows) > 1:
        every = np.concatenate([v for by in rows.values() for v in by.values()])
        medians = {ALL: float(np.median(every)), **medians}
        rows = {ALL: {}, **rows}
    step = min(STEP, TALLEST / len(rows))
    figure = style.new_figure(style.PAGE * 0.86, 1.0 + step * len(rows))
    ax = figure.subplots()
    handles = {}
    sizes = sizes_of(rows)
    for i, (effect, by) in enumerate(rows.items()):
        if i % 2:
            ax.axhspan(i - 0.5, i + 0.5, fc="#f4f4f4", ec="none", zorder=0)
        for k, size in enumerate(sizes):
            if size in by:
                look = look_of(size, k)
                y = i + (k - (len(sizes) - 1) / 2) * 0.2
                shown = np.clip(100 * by[size], LOW, HIGH)
                handles[size] = ax.plot(shown, np.full(shown.size, y), ls="none", marker=look.marker, ms=3.4,
                                        mfc="none", mec=look.color, mew=0.8, clip_on=False, zorder=3)[0]  # fmt: skip
        at = float(np.clip(100 * medians[effect], LOW, HIGH))
        handles["median"] = ax.plot([at, at], [i - 0.38, i + 0.38], color=style.INK, lw=1.8, zorder=4,
                                    clip_on=False)[0]  # fmt: skip
        ax.text(1.03, i, f"{100 * medians[effect]:.0f} %", transform=ax.get_yaxis_transform(), va="center",
                fontsize=7, color="#303030")  # fmt: skip
    if target is not None:
        line = ax.axvline(100 * target, color=style.BEFORE.color, ls=(0, (4, 2)), lw=1.1, zorder=1.5)
        handles[f"target: median of all {100 * target:.0f} %"] = line
    if len(rows) > 1:
        ax.axhline(0.5, color=style.INK, lw=0.6)
    ax.set_yticks(range(len(rows)), [label(effect, 30) for effect in rows])
    ax.get_yticklabels()[0].set_fontweight("bold" if len(rows) > 1 else "normal")
    ax.tick_params(axis="y", length=0, labelsize=8 if step > 0.15 else 6.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(LOW, HIGH)
    ax.set_xlabel("fall of the held-out 5 s error (% of what the truth gives; beyond the ends at the edge)")
    style.show_grid(ax, "x")
    ordered = [s for s in sizes if s in handles] + [h for h in handles if h not in sizes]
    figure.legend([handles[n] for n in ordered], [prose(label(n, 40)) for n in ordered], loc="outside upper center",
                  ncols=len(ordered))  # fmt: skip
    return figure
