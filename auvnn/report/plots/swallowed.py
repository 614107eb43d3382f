"""What networks of the velocity absorb of each effect, manoeuvre by manoeuvre."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label


@style.styled
def swallowed(shares: Mapping[str, Mapping[str, float | None]], *, cmap: str = "cividis") -> Figure:
    """Draw the share of each effect's trace that networks of the velocity can be trained to give.

    Args:
        shares: manoeuvre to effect to share; None where the manoeuvre does not excite the effect. Below zero
            counts as zero.
        cmap: a map of steadily rising luminance.

    Raises:
        NoData: there is no share.
    """
    manoeuvres = list(shares)
    effects = list(dict.fromkeys(e for row in shares.values() for e in row))
    if not manoeuvres or not effects:
        raise NoData("no network was trained on an effect's trace")
    table = np.array(
        [[np.nan if finite(shares[m].get(e)) is None else shares[m][e] for m in manoeuvres] for e in effects],
        dtype=float,
    )
    figure = style.new_figure(
        min(style.PAGE, 2.3 + 0.62 * len(manoeuvres)), max(1.4 + 0.32 * len(effects), 2.8)
    )
    ax = figure.subplots()
    mesh = ax.pcolormesh(
        np.ma.masked_invalid(table), vmin=0, vmax=1, cmap=cmap, edgecolors="white", linewidth=0.5
    )
    for i in range(len(effects)):
        for j in range(len(manoeuvres)):
            value = table[i, j]
            r, g, b, _ = mpl.colormaps[cmap](np.clip(value, 0, 1)) if np.isfinite(value) else (1, 1, 1, 1)
            ink = "black" if 0.299 * r + 0.587 * g + 0.114 * b > 0.55 else "white"
            text = f"{max(value, 0.0):.2f}" if np.isfinite(value) else "–"
            ax.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=8, color=ink)
    ax.set_xticks(np.arange(len(manoeuvres)) + 0.5, [label(m, 26).replace(", ", ",\n") for m in manoeuvres])
    ax.set_yticks(np.arange(len(effects)) + 0.5, [label(e, 26) for e in effects])
    ax.set_ylim(len(effects), 0)
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    figure.colorbar(mesh, ax=ax, aspect=25, label="share that networks give, $R^2$ (1)")
    return figure
