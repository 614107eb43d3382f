"""Whether stated uncertainties are true: standardised errors against the standard normal distribution."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaincinv, ndtri

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.plots.recovery import wilson

FEWEST = 5
Z95 = 1.96
# On white: over the shaded interval its own patch would vanish.
LEGEND: dict[str, Any] = {"fontsize": 7.5, "handlelength": 1.6, "borderaxespad": 0.1, "frameon": True,
                          "facecolor": "white", "edgecolor": "none", "framealpha": 1.0}  # fmt: skip


@style.styled
def coverage(z: ArrayLike) -> Figure:
    """Draw the standardised errors as a histogram, and their quantiles against those of the normal.

    Left: density, with the share of 95 % intervals that hold the true value. Right: each error against the
    value expected at its rank, with the band in which 95 % of the points of true standard errors lie, each
    point alone (the k-th of n uniform variables has a beta distribution with k and n + 1 - k).

    Args:
        z: (estimate - true value) / standard error, any shape, NaN where unknown.

    Raises:
        NoData: there are fewer than five.
    """
    values = np.asarray(z, dtype=float).ravel()
    values = np.sort(values[np.isfinite(values)])
    if values.size < FEWEST:
        raise NoData(f"too few parameters were estimated ({values.size} of the {FEWEST} that are needed)")
    # Two more than the farthest of so many true ones; what lies beyond is drawn at the edge.
    farthest = np.ceil(ndtri(1 - 0.5 / values.size)) + 2
    edge = float(np.clip(np.ceil(np.abs(values).max()), 3, max(farthest, 3)))
    figure = style.new_figure(style.PAGE, 2.9)
    left, right = figure.subplots(1, 2, width_ratios=[1.12, 1])
    _histogram(left, values, edge)
    _quantiles(right, values, edge)
    return figure


def _histogram(ax: Axes, z: NDArray[np.float64], edge: float) -> None:
    shown = np.clip(z, -edge, edge)
    width = 0.5 if z.size < 400 else 0.25
    bins = np.arange(-edge, edge + width / 2, width)
    ax.axvspan(-Z95, Z95, fc=style.SHADE, ec="none", zorder=0, label="95 % interval")
    ax.hist(shown, bins=list(bins), density=True, fc=style.BAR, ec=style.INK, lw=0.6, label="found")
    x = np.linspace(-edge, edge, 241)
    ax.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color=style.INK, lw=1.3, label="standard normal")
    inside = int((np.abs(z) < Z95).sum())
    share, low, high = (100 * x for x in (inside / z.size, *wilson(inside, z.size)))
    remark = f"{inside} of {z.size} within ±{Z95}: {share:.0f} % ({low:.0f} to {high:.0f} %)"
    beyond = int((np.abs(z) > edge).sum())
    remark += f"; {beyond} beyond ±{edge:g}" if beyond else ""
    ax.set_title(remark, fontsize=8, loc="left", pad=3)
    ax.set_ylim(0, max(ax.get_ylim()[1], 0.5) * 1.22)
    ax.set_xlim(-edge, edge)
    ax.legend(loc="upper right", **LEGEND)
    ax.set_xlabel("error / standard error, $z$")
    ax.set_ylabel("density (dimensionless)")


def _quantiles(ax: Axes, z: NDArray[np.float64], edge: float) -> None:
    rank = np.arange(1, z.size + 1)
    expected = ndtri((rank - 0.5) / z.size)
    band = [ndtri(betaincinv(rank, z.size + 1 - rank, p)) for p in (0.025, 0.975)]
    ax.fill_between(expected, *band, fc="#c4c4c4", ec="none", zorder=1, label="95 % of true standard errors")
    ax.plot([-edge, edge], [-edge, edge], color=style.INK, lw=0.8, zorder=2)
    within = np.abs(z) <= edge
    ax.plot(expected[within], z[within], ls="none", marker=style.AFTER.marker, ms=2.6,
            color=style.AFTER.color, mew=0, zorder=3, label="found")  # fmt: skip
    for side, mark in ((1, "^"), (-1, "v")):
        out = z * side > edge
        if out.any():
            ax.plot(expected[out], np.full(out.sum(), side * edge), ls="none", marker=mark, ms=5,
                    clip_on=False, color=style.BEFORE.color, zorder=3)  # fmt: skip
    reach = max(float(np.abs(expected).max()) * 1.08, 1.5)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-edge, edge)
    style.show_grid(ax, "both")
    ax.legend(loc="upper left", **LEGEND)
    ax.set_xlabel("expected at its rank, standard normal $z$")
    ax.set_ylabel("error / standard error, $z$")
