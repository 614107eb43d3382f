"""What a vehicle was told to do: each command over time, one below the other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT, decimate
from auvnn.report.panels import NoData
from auvnn.report.words import label

UNITS = {"thruster": "", "fin": "rad", "tau_X": "N", "tau_Y": "N", "tau_Z": "N"}
MOST = 12


@style.styled
def commands_over_time(t: ArrayLike, commands: Mapping[str, ArrayLike], *, limit: int = LIMIT) -> Figure:
    """Draw every command as a line of steps in a separate panel.

    Args:
        t: s, (N,).
        commands: name of the column to its values, (N,).
        limit: most points drawn of each line.

    Raises:
        NoData: there is no command.
    """
    shown = dict(list(commands.items())[:MOST])
    if not shown or not np.size(t):
        raise NoData("the log holds no command")
    columns = 2 if len(shown) > 3 else 1
    rows = -(-len(shown) // columns)
    figure = style.new_figure(style.PAGE, 0.6 + 0.85 * rows)
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for ax in axes.ravel()[len(shown) :]:
        ax.set_visible(False)
    for ax, (name, values) in zip(axes.T.ravel(), shown.items(), strict=False):
        ax.plot(*decimate(t, values, limit), color=style.INK, lw=0.8, drawstyle="steps-post")
        unit = UNITS.get(name, UNITS.get(name.rpartition("_")[0], "N m" if name.startswith("tau") else ""))
        ax.set_title(label(name) + (f" ({unit})" if unit else ""), loc="left", fontsize=8, pad=2)
        style.show_grid(ax, "both")
    for ax in axes[-1]:
        ax.set_xlabel(style.axis_label("t", "s"))
    return figure
