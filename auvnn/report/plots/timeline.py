"""What the log holds when: valid samples, missing samples and gaps, channel by channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from auvnn.report import style
from auvnn.report.decimate import gaps
from auvnn.report.panels import NoData
from auvnn.report.words import label

BINS = 600
NONE, VALID, PARTLY, MISSING = 0, 1, 2, 3
_INKS = ["#ffffff", "#bcd6ea", "#5f8fb4", "#1a1a1a"]
_WORDS = ["no samples", "complete", "partly missing", "missing"]


@style.styled
def timeline(runs: Sequence[Mapping[str, Any]], *, bins: int = BINS) -> Figure:
    """Draw one row per channel over time, the runs one after the other; wedges above mark gaps in time.

    Args:
        runs: {run: number, t: (N,) s, channels: {name: (N,) values, NaN where missing}}; a channel that a run
            lacks counts as missing there.
        bins: how many columns the whole record has at most.

    Raises:
        NoData: there is no run with two samples and a channel.
    """
    runs = [r for r in runs if np.size(r.get("t", ())) > 1 and r.get("channels")]
    names = list(dict.fromkeys(name for run in runs for name in run["channels"]))
    if not names:
        raise NoData("there is no run with two samples and a channel")
    figure = style.new_figure(style.PAGE, max(1.7, 0.95 + 0.17 * len(names)))
    ax = figure.subplots()
    spans = [float(np.ptp(np.asarray(run["t"], dtype=float))) for run in runs]
    pause = min(0.012, 0.3 / len(runs)) * sum(spans) if len(runs) > 1 else 0.0
    norm = BoundaryNorm(np.arange(-0.5, 4), 4)
    start, ticks = 0.0, []
    for run, span in zip(runs, spans, strict=True):
        t = np.asarray(run["t"], dtype=float).ravel()
        columns = max(1, min(round(bins * span / max(sum(spans), 1e-9)), t.size // 2))
        classes = np.stack([occupancy(t, run["channels"].get(name), columns) for name in names])
        x = start + np.linspace(0, span, columns + 1)
        ax.pcolormesh(
            x, np.arange(len(names) + 1), classes, cmap=ListedColormap(_INKS), norm=norm, rasterized=True
        )
        breaks = gaps(t)
        for k in breaks[np.argsort(t[breaks] - t[breaks + 1], kind="stable")[:50]]:
            hole = (start + t[k] - t[0], start + t[k + 1] - t[0])
            ax.axvspan(*hole, fc="white", ec="#a0a0a0", hatch="/////", lw=0, zorder=1.5)
        middle = start + (t[breaks] + t[breaks + 1]) / 2 - t[0]
        ax.plot(
            middle,
            np.full(middle.size, -0.3),
            ls="none",
            marker="v",
            ms=4,
            color=style.BEFORE.color,
            clip_on=False,
        )
        ticks.append((start, start + span, label(str(run.get("run", "")), 8)))
        if start > 0:
            ax.axvline(start - pause / 2, color=style.INK, lw=0.6, ls=(0, (1, 1)))
        start += span + pause
    for i in range(1, len(names)):
        ax.axhline(i, color="white", lw=1.2)
    ax.set_ylim(len(names), 0)
    ax.set_xlim(0, max(start - pause, 1e-9))
    ax.set_yticks(np.arange(len(names)) + 0.5, [label(name, 24) for name in names])
    ax.tick_params(axis="y", length=0, labelsize=8, pad=2)
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(
        "time on record, runs one after the other (s)" if len(runs) > 1 else "time since the start (s)"
    )
    if 1 < len(runs) <= 24:
        for begin, end, word in ticks:
            word = f"run {word}" if len(runs) <= 12 else word
            ax.annotate(
                word,
                ((begin + end) / 2, 0),
                xytext=(0, 10),
                textcoords="offset points",
                ha="center",
                fontsize=7,
            )
    handles: list[Any] = [
        Patch(fc=ink, ec="#606060", hatch="" if k else "/////", label=word)
        for k, (ink, word) in enumerate(zip(_INKS, _WORDS, strict=True))
    ]
    mark = ax.plot([], [], ls="none", marker="v", ms=4, color=style.BEFORE.color, label="gap in time")[0]
    figure.legend(handles=[*handles, mark], loc="outside upper center", ncols=5)
    return figure


def occupancy(t: np.ndarray, values: Any, columns: int) -> np.ndarray:
    """Return for equal slices of time whether the samples in them are there (one of the four classes).

    Args:
        t: times, s, (N,).
        values: of a channel, (N,), NaN where missing; None where there is no such channel.
        columns: number of slices.
    """
    edges = np.linspace(t[0], t[-1], columns + 1)
    index = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, columns - 1)
    total = np.bincount(index, minlength=columns)
    valid = np.zeros(columns)
    if values is not None:
        valid = np.bincount(
            index, weights=np.isfinite(np.asarray(values, dtype=float).ravel()), minlength=columns
        )
    classes = np.where(valid >= total, VALID, np.where(valid > 0, PARTLY, MISSING))
    return np.where(total == 0, NONE, classes)
