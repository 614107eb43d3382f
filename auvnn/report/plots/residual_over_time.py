"""The residual wrench over time, with the noise that it would have if nothing were missing."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT, decimate
from auvnn.report.panels import NoData, columns, six_panels
from auvnn.report.words import label


@style.styled
def residual_over_time(
    t: ArrayLike,
    residual: ArrayLike,
    noise_floor: ArrayLike | None = None,
    *,
    title: str = "",
    limit: int = LIMIT,
) -> Figure:
    """Draw what the model lacks, in six panels, with a band of two noise standard deviations.

    Args:
        t: s, (N,).
        residual: M nu_dot + C nu + D nu + g - tau, N and N m, (N, 6).
        noise_floor: its standard deviation from sensor noise alone, (6,).
        title: above the panels.
        limit: most points drawn (min/max decimation).

    Raises:
        NoData: there is no residual.
    """
    t, table = np.asarray(t, dtype=float).ravel(), columns(residual, "residual")
    if not np.isfinite(table).any():
        raise NoData("there is no residual over time")
    floor = np.full(6, np.nan) if noise_floor is None else np.asarray(noise_floor, dtype=float).ravel()
    figure, axes = six_panels()
    for i, (ax, (symbol, unit)) in enumerate(zip(axes, style.WRENCH, strict=True)):
        if i < floor.size and np.isfinite(floor[i]) and floor[i] > 0:
            ax.axhspan(-2 * floor[i], 2 * floor[i], fc="#c4c4c4", ec="none", zorder=0)
        ax.axhline(0, color=style.FAINT, lw=0.5)
        ax.plot(*decimate(t, table[:, i], limit), color=style.AFTER.color, lw=0.7)
        ax.set_ylabel(style.axis_label(symbol, unit))
    for ax in (axes[2], axes[5]):
        ax.set_xlabel(style.axis_label("t", "s"))
    figure.align_ylabels()
    band = [Patch(fc="#c4c4c4", label="noise (two standard deviations)")] if np.isfinite(floor).any() else []
    figure.legend(handles=band, loc="outside upper center", title=label(title, 90) or None)
    return figure
