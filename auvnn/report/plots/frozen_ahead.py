"""How far a model runs free with the weights of each moment: what online learning has learned of the vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import label

# The networks as they were trained come first; the others look as they do in the figures of velocity.
LOOKS = (style.MEASURED, style.BEFORE, style.AFTER, style.REFITTED, style.PERSISTENCE)


@style.styled
def frozen_ahead(
    windows: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    ahead: float,
    mark: float | None = None,
    mark_words: str = "",
) -> Figure:
    """Draw the error of each free run over the time at which its weights were frozen, on a log axis.

    Args:
        windows: name to (start times, s; rms error over the range of the plant's velocity, 1).
        ahead: how long each runs, s.
        mark: a time to be marked, s.
        mark_words: what it is.

    Raises:
        NoData: there is no window.
    """
    tables = {n: (np.asarray(t, float), 100.0 * np.asarray(e, float)) for n, (t, e) in windows.items()}
    if not any(np.isfinite(e).any() for _, e in tables.values()):
        raise NoData("no window was run")
    figure = style.new_figure(style.PAGE * 0.8, 2.9)
    ax = figure.subplots()
    for (name, (t, error)), look in zip(tables.items(), LOOKS, strict=False):
        shown = np.where(error > 0, error, np.nan)
        # The first is broad and pale: where another coincides with it, it shows on either side.
        ink = {"color": "#b5b5b5", "lw": 3.2} if look is LOOKS[0] else {"color": look.color, "lw": 1.3}
        ax.plot(t, shown, ls=look.dashes, label=label(name), **ink)
    if mark is not None:
        ax.axvline(mark, color=style.FAINT, lw=0.8, ls=(0, (1, 1.5)), zorder=0.5)
        ax.annotate(
            label(mark_words), (mark, 0.99), xycoords=("data", "axes fraction"), xytext=(2, -1), va="top",
            textcoords="offset points", fontsize=7, color="#505050",
        )  # fmt: skip
    style.log_scale(ax, "y")
    ax.set_xlabel(f"time $t$ at which the weights are frozen (s); then {ahead:g} s of free running")
    ax.set_ylabel("rms error (% of the range)")
    style.show_grid(ax, "both")
    figure.legend(loc="outside upper center", ncols=len(tables))
    return figure
