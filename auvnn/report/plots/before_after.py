"""A held-out run: measured, the model as given, and the model with what was missing."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.decimate import LIMIT
from auvnn.report.panels import time_series
from auvnn.report.plots.measured_against_model import rms_remarks


@style.styled
def before_after(
    t: ArrayLike,
    measured: ArrayLike,
    before: ArrayLike,
    after: ArrayLike,
    refitted: ArrayLike | None = None,
    *,
    symbols: Sequence[tuple[str, str]] = style.VELOCITY,
    title: str = "",
    limit: int = LIMIT,
) -> Figure:
    """Draw six panels with the measurement, the model as given, refitted (optional) and extended.

    Each panel says its rms error before and after.

    Args:
        t: s, (N,).
        measured: (N, 6), NaN where missing.
        before: (N, 6), of the model as given.
        after: (N, 6), of the model with the added effects.
        refitted: (N, 6), of the model whose coefficients alone were fitted again.
        symbols: symbol and unit of each column.
        title: above the legend.
        limit: most points drawn of each line (min/max decimation).

    Raises:
        NoData: there is nothing to draw.
    """
    remarks = rms_remarks(measured, {"before": before, "after": after}, symbols)
    # Refitted first: the two often coincide, and the dots of the model as given must stay visible on it.
    lines = {"measured": measured} | ({} if refitted is None else {"refitted": refitted})
    lines |= {"as given": before, "after": after}
    return time_series(t, lines, symbols=symbols, remarks=remarks, title=title, limit=limit)
