"""What is left of the error over time, model by model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT
from auvnn.report.panels import columns, time_series


@style.styled
def error_over_time(
    t: ArrayLike,
    measured: ArrayLike,
    models: Mapping[str, ArrayLike],
    *,
    symbols: Sequence[tuple[str, str]] = style.VELOCITY,
    title: str = "",
    limit: int = LIMIT,
) -> Figure:
    """Draw model minus measurement in six panels, one line per model.

    Args:
        t: s, (N,).
        measured: (N, 6), NaN where missing.
        models: name to (N, 6), NaN where the model did not run; "as given", "refitted" and "after" keep the
            inks that they have elsewhere.
        symbols: symbol and unit of each column.
        title: above the legend.
        limit: most points drawn of each line (min/max decimation).

    Raises:
        NoData: there is nothing to draw.
    """
    truth = columns(measured, "measured")
    # A diverged model overflows here, and is drawn as missing from there on.
    with np.errstate(all="ignore"):
        errors = {name: columns(model, name) - truth for name, model in models.items()}
    shown = [(rf"\Delta {symbol}", unit) for symbol, unit in symbols]
    return time_series(t, errors, symbols=shown, title=title, limit=limit, reference=False)
