"""Columns that lag behind their stamps, put back to the time to which they belong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ConfigError
from auvnn.logs.channels import EULER, QUATERNION
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.repairs.repair import Repair

Array = NDArray[np.float64]


def undo_delays(
    columns: dict[str, Array], plan: Mapping, where: str
) -> tuple[dict[str, Array], list[Repair]]:
    """Return one run's columns with the mapping's delays taken out: x(t) <- x(t + delay).

    Between two rows the value is interpolated; beyond the record, and between rows of which one is missing or
    which are more than five median steps apart, it is missing.

    Args:
        columns: by canonical name, (N,) each, `t` among them in order.
        plan: the mapping.
        where: file and run, for the quality report.

    Raises:
        ConfigError: an attitude is delayed, which cannot be interpolated number by number.
    """
    late = {n: c.delay for n, c in plan.columns.items() if c.delay != 0.0}
    if not late:
        return columns, []
    turned = [n for n in late if n in EULER + QUATERNION]
    if turned:
        raise ConfigError(
            f"{plan.where}: columns: {turned[0]}: angles and quaternions take no delay, for they cannot be "
            "interpolated one by one; give the other columns a negative delay instead"
        )
    t, out = columns["t"], dict(columns)
    step = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    for name, delay in late.items():
        out[name] = _at(t + delay, t, columns[name], 5.0 * step)
    words = ", ".join(f"{n} {d:g} s" for n, d in late.items())
    return out, [Repair(f"columns put back by their delay: {words}", where, len(late), "info")]


def _at(wanted: Array, t: Array, x: Array, gap: float) -> Array:
    """Return x at other times, linear between rows, NaN where nothing reliable lies around."""
    # Stamps that agree to rounding are the same row.
    slack = 1e-6 * max(gap, 1e-9)
    right = np.clip(np.searchsorted(t, wanted - slack), 0, len(t) - 1)
    same = np.abs(t[right] - wanted) <= slack
    left = np.where(same, right, np.maximum(right - 1, 0))
    span = t[right] - t[left]
    share = np.where(span > 0, (wanted - t[left]) / np.where(span > 0, span, 1.0), 0.0)
    value = x[left] + share * (x[right] - x[left])
    outside = (wanted < t[0] - slack) | (wanted > t[-1] + slack)
    return np.where(outside | (span > gap), np.nan, np.where(same, x[right], value))
