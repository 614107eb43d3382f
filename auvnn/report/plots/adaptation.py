"""Online adaptation: an error with it and without it over time, how far weights moved, what was not learned from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.decimate import LIMIT, decimate
from auvnn.report.panels import NoData, six_panels
from auvnn.report.words import label

# Of the largest error: what lies lower is not shown.
DECADES = 1e-5


@style.styled
def with_and_without(
    t: Any,
    adapted: Any,
    unadapted: Any,
    *,
    names: Sequence[tuple[str, str]],
    changes: Sequence[tuple[float, str]] = (),
    lengths: Sequence[int] = (),
) -> Figure:
    """Draw a root mean square error of six channels over time, with adaptation and without.

    Args:
        t: (N,) s, the runs one after the other.
        adapted: (N, 6); NaN where nothing was compared.
        unadapted: (N, 6).
        names: symbol and unit of each channel.
        changes: time and kind of the changes that were seen.
        lengths: rows of each run, where there are several: no line is drawn from one to the next.

    Raises:
        NoData: there is nothing to compare.
    """
    t = np.asarray(t, dtype=float).ravel()
    both = [np.asarray(v, dtype=float).reshape(-1, 6) for v in (adapted, unadapted)]
    if not t.size or not any(np.isfinite(v).any() for v in both):
        raise NoData("no sample could be compared with the model")
    edges = np.cumsum([0, *lengths]) if lengths else np.array([0, t.size])
    figure, axes = six_panels(4.8)
    for i, ax in enumerate(axes):
        drawn = []
        for values, look, name in zip(
            both[::-1], (style.BEFORE, style.AFTER), ("without adaptation", "with adaptation"), strict=True
        ):
            y = values[:, i]
            if np.isfinite(y).any():
                drawn.append(y[np.isfinite(y)])
                # The one below is broad: where both are the same, it shows on either side of the upper one.
                below = look is style.BEFORE
                ink: dict[str, Any] = (
                    {"color": "#f0b183", "lw": 3.0} if below else {"color": look.color, "lw": 1.0}
                )
                for first, last in pairwise(edges):
                    words: dict[str, Any] = {"label": name} if first == 0 else {}
                    ax.plot(*decimate(t[first:last], y[first:last], LIMIT), **ink, **words)
        if drawn:
            found = np.concatenate(drawn)
            found = found[found > 0]
            if found.size and found.max() > 100 * np.quantile(found, 0.1):
                ax.set_yscale("log")
                # Samples that happen to fit exactly must not stretch the axis over many decades.
                ax.set_ylim(bottom=max(float(np.quantile(found, 0.01)) / 1.5, DECADES * float(found.max())))
        for edge in edges[1:-1]:
            ax.axvline(t[edge], color=style.FAINT, lw=0.6)
        _mark(ax, changes, words=i in (0, 3))
        symbol, unit = names[i]
        ax.set_ylabel(f"rms error of ${symbol}$\n({unit})", fontsize=8)
        style.show_grid(ax)
        if i in (2, 5):
            ax.set_xlabel("time (s)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def _mark(ax: Axes, changes: Sequence[tuple[float, str]], *, words: bool) -> None:
    """Mark changes by lines, and above the panel by their numbers: as words they would cover one another."""
    for time, _ in changes:
        ax.axvline(time, color=style.INK, lw=0.7, ls=(0, (1, 1)))
    low, high = ax.get_xlim()
    least = 0.055 * (high - low)
    groups: list[list[int]] = []
    for k in sorted(range(len(changes)), key=lambda k: changes[k][0]):
        if groups and changes[k][0] - changes[groups[-1][0]][0] < least:
            groups[-1].append(k)
        else:
            groups.append([k])
    for group in groups if words else []:
        said = f"{group[0] + 1}" if len(group) == 1 else f"{group[0] + 1}-{group[-1] + 1}"
        ax.annotate(
            said, (changes[group[0]][0], 1), xycoords=("data", "axes fraction"), xytext=(0, 1.5),
            textcoords="offset points", fontsize=7, va="bottom", ha="left" if len(group) > 1 else "center",
            annotation_clip=False,
        )  # fmt: skip


@style.styled
def movement(t: Any, moved: Any, learned: Any, *, changes: Sequence[tuple[float, str]] = ()) -> Figure:
    """Draw how far the weights have moved, and below it when samples were learned from.

    Args:
        t: (N,) s.
        moved: (N,) distance of the parameters from where they began, relative to their size.
        learned: (N,) whether the samples around that moment were learned from.
        changes: time and kind of the changes that were seen.

    Raises:
        NoData: there is no sample.
    """
    t, moved = np.asarray(t, dtype=float).ravel(), np.asarray(moved, dtype=float).ravel()
    learned = np.asarray(learned, dtype=bool).ravel()
    if t.size < 2:
        raise NoData("there is no time history")
    figure = style.new_figure(style.PAGE, 2.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[5, 1])
    upper.plot(*decimate(t, moved, LIMIT), color=style.AFTER.color, lw=1.1)
    upper.set_ylabel("parameter movement (1)")
    upper.set_ylim(bottom=0)
    _mark(upper, changes, words=True)
    style.show_grid(upper)
    lower.fill_between(t, 0, learned.astype(float), step="post", color=style.BAR, lw=0)
    lower.set_yticks([])
    lower.set_ylabel("learning", rotation=0, ha="right", va="center", fontsize=8)
    lower.set_xlabel("time (s)")
    return figure


@style.styled
def skipped(counts: Mapping[str, int]) -> Figure:
    """Draw how many samples were not learned from, by reason; learned ones first.

    Args:
        counts: samples by reason, in the order in which they are drawn.

    Raises:
        NoData: there is no sample.
    """
    names = [n for n, c in counts.items() if c > 0]
    if not names:
        raise NoData("there is no sample")
    values = [counts[n] for n in names]
    figure = style.new_figure(style.COLUMN * 1.25, 0.7 + 0.24 * len(names))
    ax = figure.subplots()
    rows = np.arange(len(names))
    ax.barh(rows, values, color=style.BAR, ec=style.INK, lw=0.5, height=0.7)
    for row, value in zip(rows, values, strict=True):
        ax.annotate(
            f"{value}", (value, row), xytext=(3, 0), textcoords="offset points", va="center", fontsize=8
        )
    ax.set_yticks(rows, [label(n.replace("_", " "), 30) for n in names])
    ax.invert_yaxis()
    ax.set_xlim(0, 1.15 * max(values))
    ax.set_xlabel("samples")
    style.show_grid(ax, "x")
    return figure
