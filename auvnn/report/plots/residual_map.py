"""Where the residual sits: degree of freedom by regime, in units of the noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import label, number

COLUMNS = 3
FEW = 20  # samples in a bin below which its rms is printed in brackets


@style.styled
def residual_map(
    regimes: Mapping[str, Mapping[str, Any]],
    noise_floor: ArrayLike | None = None,
    *,
    cmap: str = "cividis",
) -> Figure:
    """Draw one heat map per regime: six rows, one column per bin, the number written in each cell.

    Args:
        regimes: name to {edges: (bins + 1,), unit, rms: (6, bins) in N and N m, count: (bins,)}.
        noise_floor: of the residual wrench, (6,); without it each row is divided by its own rms.
        cmap: a map of steadily rising luminance, so that it reads in grey.

    Raises:
        NoData: no regime has a bin with samples.
    """
    floor = None if noise_floor is None else np.asarray(noise_floor, dtype=float).ravel()
    known = floor is not None and floor.size == 6 and bool(np.all(np.isfinite(floor) & (floor > 0)))
    tables = {}
    for name, regime in regimes.items():
        ratio = relative_rms(regime, floor if known else None)
        if ratio is not None and np.isfinite(ratio).any():
            tables[name] = ratio
    if not tables:
        raise NoData("no regime has samples")
    top = max(float(np.nanmax(table)) for table in tables.values())
    low, high = 1.0 if known else 0.2, max(top, 3.0)
    norm = LogNorm(low, high)
    rows = -(-len(tables) // COLUMNS)
    figure = style.new_figure(style.PAGE, 0.55 + 1.55 * rows)
    grid = figure.subplots(rows, COLUMNS, squeeze=False)
    mesh: Any = None
    for i, (name, ratio) in enumerate(tables.items()):
        ax = grid.flat[i]
        mesh = ax.pcolormesh(
            np.ma.masked_invalid(ratio), norm=norm, cmap=cmap, edgecolors="white", linewidth=0.5
        )
        _cells(ax, ratio, np.asarray(regimes[name].get("count", np.full(ratio.shape[1], np.inf))), norm, cmap)
        _frame(ax, name, regimes[name], first=i % COLUMNS == 0)
    spare = list(grid.flat[len(tables) :])
    for ax in spare:
        ax.set_axis_off()
    words = "rms residual / noise floor" if known else "rms residual / its rms over all bins"
    if spare:
        # The key goes where the grid has room.
        key = spare[0].inset_axes((0.06, 0.52, 0.5 + 1.08 * (len(spare) - 1), 0.1))
        key.set_in_layout(False)
        where: dict[str, Any] = {"cax": key, "orientation": "horizontal"}
    else:
        where = {"ax": list(grid.flat), "shrink": 0.5, "aspect": 40, "location": "top"}
    bar = figure.colorbar(mesh, label=words, **where)
    ticks = [v for v in (0.2, 0.5, 1, 2, 3, 5, 10, 20, 30, 50, 100, 300, 1000) if low <= v <= high]
    bar.set_ticks(ticks, labels=[f"{v:g}" for v in ticks])
    bar.minorticks_off()
    if spare:
        style.note(spare[0], "in brackets: few samples; hatched: none", x=0.06, y=0.05, ha="left")
    return figure


def relative_rms(regime: Mapping[str, Any], floor: np.ndarray | None) -> np.ndarray | None:
    """Return rms over the noise floor (6, bins), NaN where a bin is empty; None where there is no table."""
    rms = np.asarray(regime.get("rms", []), dtype=float)
    if rms.ndim != 2 or rms.shape[0] != 6 or rms.shape[1] == 0:
        return None
    n = np.asarray(regime.get("count", np.ones(rms.shape[1])), dtype=float).ravel()
    if n.size == rms.shape[1]:
        rms = np.where(n > 0, rms, np.nan)
    if floor is None:
        good = np.isfinite(rms)
        total = np.square(np.where(good, rms, 0)).sum(axis=1) / np.maximum(good.sum(axis=1), 1)
        floor = np.sqrt(np.where(total > 0, total, np.nan))
    with np.errstate(all="ignore"):
        return rms / floor[:, None]


def _cells(ax: Axes, ratio: np.ndarray, counts: np.ndarray, norm: LogNorm, cmap: str) -> None:
    colors = mpl.colormaps[cmap](norm(np.nan_to_num(ratio, nan=1.0)))
    size = 6.5 if ratio.shape[1] <= 9 else 5.0
    for (i, j), value in np.ndenumerate(ratio):
        if not np.isfinite(value):
            ax.add_patch(Rectangle((j, i), 1, 1, fc="white", ec="#b0b0b0", hatch="////", lw=0))
        elif ratio.shape[1] <= 14:
            luminance = colors[i, j, :3] @ (0.299, 0.587, 0.114)
            text = number(value, 2) if value < 99.5 else f"{value:.0f}"
            text = f"({text})" if j < counts.size and counts[j] < FEW else text
            ink = "black" if luminance > 0.55 else "white"
            ax.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=size, color=ink)


def _frame(ax: Axes, name: str, regime: Mapping[str, Any], first: bool) -> None:
    bins = np.asarray(regime["rms"]).shape[1]
    ax.set_xlim(0, bins)
    ax.set_ylim(6, 0)
    ax.set_yticks(np.arange(6) + 0.5, [f"${s}$" for s, _ in style.WRENCH] if first else [""] * 6)
    ax.tick_params(length=0, pad=2)
    ax.tick_params(axis="x", labelsize=7)
    for spine in ax.spines.values():
        spine.set_visible(False)
    unit = str(regime.get("unit", ""))
    ax.set_xlabel(label(name) + (f" ({label(unit)})" if unit and unit != "1" else ""), labelpad=1)
    edges = np.asarray(regime.get("edges", []), dtype=float).ravel()
    if edges.size == bins + 1 and np.isfinite(edges).all():
        every = 1 if bins <= 7 else 2
        at = np.arange(0, bins + 1, every)
        ax.set_xticks(at, [_edge(float(edges[k]), edges) for k in at])
    else:
        ax.set_xticks([])


def _edge(value: float, edges: Sequence[float] | np.ndarray) -> str:
    step = float(np.min(np.diff(edges))) if len(edges) > 1 else 1.0
    decimals = int(np.clip(1 - np.floor(np.log10(abs(step))), 0, 3)) if step else 2
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return ("0" if text in ("-0", "") else text).replace("-", "\N{MINUS SIGN}")
