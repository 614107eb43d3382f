"""How well parameters are known alone, together, and with networks of the velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label

SERIES = (
    ("alone_over_prior", "everything else known", "x", style.FAINT),
    ("together_over_prior", "all uncertain at once", "o", style.AFTER.color),
    ("with_networks_over_prior", "damping is six networks", "^", style.BEFORE.color),
)
LEAST = 1e-4


@style.styled
def identifiability(manoeuvres: Mapping[str, Sequence[Mapping[str, Any]]], known: float = 0.5) -> Figure:
    """Draw each parameter's standard error over what was known before, one panel a manoeuvre.

    Args:
        manoeuvres: name to rows {effect, parameter, alone_over_prior, together_over_prior,
            with_networks_over_prior or None}, the same parameters in the same order.
        known: left of this a parameter counts as identified.

    Raises:
        NoData: there is no parameter.
    """
    rows = next(iter(manoeuvres.values()), [])
    if not rows:
        raise NoData("no parameter was judged")
    figure = style.new_figure(style.PAGE, 0.9 + 0.165 * len(rows))
    grid = np.atleast_1d(figure.subplots(1, len(manoeuvres), sharey=True))
    where = np.arange(len(rows))
    handles: dict[str, Any] = {}
    for ax, (name, found) in zip(grid, manoeuvres.items(), strict=True):
        ax.axvspan(known, 2.0, fc=style.SHADE, ec="none", zorder=0)
        for key, words, marker, color in SERIES:
            values = [finite(row.get(key)) for row in found]
            x = np.array([np.nan if v is None else max(v, LEAST) for v in values])
            if np.isfinite(x).any():
                look = {"mfc": "none"} if marker == "^" else {}
                handles[words] = ax.plot(x, where, ls="none", marker=marker, color=color, ms=4, **look)[0]
        ax.set_xscale("log")
        ax.set_xlim(LEAST * 0.7, 1.6)
        ax.set_title(label(name, 20))
        ax.grid(axis="y")
    figure.supxlabel("standard error over that before the manoeuvre (1)", fontsize=9)
    grid[0].set_yticks(where, [f"{label(str(r['effect']), 20)} {r['parameter']}" for r in rows])
    grid[0].set_ylim(len(rows) - 0.4, -0.6)
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=len(handles))
    return figure
