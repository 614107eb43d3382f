"""Whether the tests' p-values are what they claim to be where nothing is hidden: uniform, or larger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import betaincinv

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.plots.recovery import wilson
from auvnn.report.words import label

FEWEST = 5
LEVEL = 0.05
STEP, TALLEST = 0.135, 9.0  # inches: a row of the right panel, and the whole figure


@style.styled
def uniformity(p_values: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the p-values of each test against those expected at their ranks, and how many are below 0.05.

    Left: one thin line for each effect's test, with the band in which 95 % of the points of uniform p-values lie,
    each point alone. A line below the band is a test that rejects too often; above it, one that rejects too
    rarely. Right: the share of each effect's p-values that is below 0.05, with Wilson's 95 % interval.

    Args:
        p_values: effect to the p-values of its test on logs that hide nothing.

    Raises:
        NoData: there are fewer than five such logs.
    """
    found = {}
    for name, values in p_values.items():
        sound = np.asarray(values, dtype=float).ravel()
        sound = np.sort(sound[np.isfinite(sound)])
        if sound.size >= FEWEST:
            found[name] = sound
    if not found:
        raise NoData(f"fewer than {FEWEST} logs hide nothing")
    height = float(np.clip(STEP * len(found) + 0.9, 3.1, TALLEST))
    figure = style.new_figure(style.PAGE, height)
    left, right = figure.subplots(1, 2, width_ratios=[1.05, 1])
    _ranks(left, found)
    _below(right, found)
    return figure


def _ranks(ax: Axes, found: Mapping[str, np.ndarray]) -> None:
    most = max(v.size for v in found.values())
    rank = np.arange(1, most + 1)
    low, high = (betaincinv(rank, most + 1 - rank, p) for p in (0.025, 0.975))
    expected = rank / (most + 1)
    ax.fill_between(expected, low, high, fc="#c4c4c4", ec="none", label="95 % of uniform p-values", zorder=1)
    ax.plot([0, 1], [0, 1], color=style.INK, lw=0.8, zorder=2)
    for k, values in enumerate(found.values()):
        at = np.arange(1, values.size + 1) / (values.size + 1)
        more: dict[str, Any] = {"label": "one test each"} if k == 0 else {}
        ax.plot(at, values, color=style.AFTER.color, lw=0.45, alpha=0.6, zorder=3, **more)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_box_aspect(1)
    ax.set_anchor("N")
    style.show_grid(ax, "both")
    # Above the panel: inside it any place may hold a line.
    ax.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=7.5, borderaxespad=0.1, frameon=False
    )
    ax.set_xlabel("expected at its rank, uniform $p$")
    ax.set_ylabel("found, $p$")


def _below(ax: Axes, found: Mapping[str, np.ndarray]) -> None:
    size = 7.5 if len(found) <= 24 else 6.5
    for y, values in enumerate(found.values()):
        hits = int((values < LEVEL).sum())
        share, (low, high) = hits / values.size, wilson(hits, values.size)
        ax.errorbar(100 * share, y, xerr=[[100 * max(share - low, 0)], [100 * max(high - share, 0)]], fmt="o",
                    color=style.INK, ms=3, capsize=1.5, lw=0.8, clip_on=False, zorder=3)  # fmt: skip
    ax.axvline(100 * LEVEL, color=style.BEFORE.color, ls=(0, (4, 2)), lw=1.1, zorder=1)
    ax.set_yticks(range(len(found)), [label(name, 30) for name in found], fontsize=size)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(found) - 0.5, -0.5)
    ax.set_xlim(left=0)
    style.show_grid(ax, "x")
    ax.set_xlabel(f"$p$ below {LEVEL:g} (% of the logs; 95 % interval)")
