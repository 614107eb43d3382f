"""The training: error on the fitted and on the held-out data over the epochs."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT, decimate
from auvnn.report.panels import NoData
from auvnn.report.words import label, number


@style.styled
def history(
    train: ArrayLike,
    held_out: ArrayLike = (),
    *,
    steps: ArrayLike | None = None,
    step: str = "epoch",
    error: str = "error (dimensionless)",
) -> Figure:
    """Draw both errors over the steps of the fit, logarithmic, with the best held-out step marked.

    Args:
        train: error on the fitted data after each step.
        held_out: error on the held-out data after each step; may be empty.
        steps: their numbers; counted from 0 where absent.
        step: what a step is called.
        error: what the error is, with its unit.

    Raises:
        NoData: no step has an error.
    """
    figure = style.new_figure(style.COLUMN * 1.25, 2.5)
    ax = figure.subplots()
    numbers = None if steps is None else np.asarray(steps, dtype=float).ravel()
    drawn = []
    for values, look, name in (
        (train, style.BEFORE, "fitted data"),
        (held_out, style.AFTER, "held-out data"),
    ):
        y = np.asarray(values, dtype=float).ravel()
        x = numbers[: y.size] if numbers is not None and numbers.size >= y.size else np.arange(y.size)
        if np.isfinite(y).any():
            drawn.append(y)
            ax.plot(*decimate(x, y, LIMIT), color=look.color, ls=look.dashes, lw=1.2, label=name)
            if name == "held-out data":
                best = int(np.nanargmin(np.where(np.isfinite(y), y, np.inf)))
                ax.plot(
                    x[best],
                    y[best],
                    marker="o",
                    ms=6,
                    mfc="none",
                    mec=style.INK,
                    ls="none",
                    label=f"best: {number(y[best])} at {label(step)} {x[best]:.0f}",
                )
    if not drawn:
        raise NoData("no step of the training has an error")
    values = np.concatenate(drawn)
    values = values[np.isfinite(values)]
    # Within a factor of twenty a logarithmic axis has next to no labels.
    if values.min() > 0 and values.max() > 20 * values.min():
        ax.set_yscale("log")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    ax.set_xlabel(label(step))
    ax.set_ylabel(label(error, 60))
    style.show_grid(ax, "y")
    figure.legend(loc="outside upper center", ncols=2)
    return figure
