"""Long records made short enough to send and draw: extremes by pixel, gaps kept, one time base for all series."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.signals.segments import default_gap

Array = NDArray[np.float64]
POINTS = 1600
DIGITS = 6


def thin(
    t: Array, series: Mapping[str, Array], points: int = POINTS, gap: float | None = None
) -> dict[str, Any]:
    """Return records of one run, thinned to about `points` samples on a common time base.

    Neighbouring samples share a bucket, of which each series gives its smallest and largest value in the order in
    which they occurred: no spike is lost. A gap in time is kept as an entry without values.

    Args:
        t: time, s, (N,), increasing.
        series: name to values, (N,), NaN where missing.
        points: about how many samples to return.
        gap: s, a longer step is a gap; worked out from the record where None.

    Returns:
        `t` and `series` as lists, null where there is no value; `thinned`, whether anything was left out.
    """
    stride = -(-2 * len(t) // max(points, 16))
    if stride <= 2:
        pairs, times = dict(series), t
    else:
        edges = np.arange(0, len(t), stride)
        last = np.minimum(edges + stride, len(t)) - 1
        times = np.stack([t[edges], t[last]], axis=1)
        # The time base must increase strictly; a bucket of one sample gives it once.
        single = last == edges
        keep = np.ones(times.shape, dtype=bool)
        keep[single, 1] = False
        pairs = {name: _extremes(values, edges)[keep] for name, values in series.items()}
        times = times[keep]
    # Judged in the full record: neighbouring points of a thinned one lie a bucket apart.
    longest = default_gap(t) if gap is None else gap
    gaps = np.flatnonzero(np.diff(t) > longest) if len(t) > 1 else np.zeros(0, dtype=np.intp)
    at = np.unique(np.searchsorted(times, t[gaps], side="right"))
    at = at[(at > 0) & (at < len(times))]
    middle = 0.5 * (times[at - 1] + times[at])
    return {
        "t": np.round(np.insert(times, at, middle), 6).tolist(),
        "series": {name: _numbers(np.insert(values, at, np.nan)) for name, values in pairs.items()},
        "thinned": stride > 2,
    }


def part(t: Array, low: float | None, high: float | None) -> slice:
    """Return the samples from `low` to `high` s, with one more at each end so that lines reach the border.

    Args:
        t: times, s, increasing, (N,).
        low: begin, s; from the first sample where None.
        high: end, s; to the last sample where None.
    """
    first = 0 if low is None else max(int(np.searchsorted(t, low)) - 1, 0)
    last = len(t) if high is None else min(int(np.searchsorted(t, high, side="right")) + 1, len(t))
    return slice(first, max(last, first))


def intervals(t: Array, mask: NDArray[np.bool_], most: int = 400) -> list[list[float]]:
    """Return where a mask holds as [begin, end] in s; neighbours that are nearest are joined beyond `most`.

    Args:
        t: times, s, (N,).
        mask: where it holds, (N,).
        most: most intervals that are returned.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    begin, end = edges[::2], edges[1::2] - 1
    if len(begin) > most:
        gaps = t[begin[1:]] - t[end[:-1]]
        kept = np.sort(np.argsort(gaps)[-(most - 1) :])
        begin, end = np.concatenate([begin[:1], begin[kept + 1]]), np.concatenate([end[kept], end[-1:]])
    half = 0.5 * float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    return [[float(t[a]) - half, float(t[b]) + half] for a, b in zip(begin, end, strict=True)]


def _extremes(values: Array, edges: NDArray[np.intp]) -> Array:
    """Return each bucket's smallest and largest value in their order, (B, 2); NaN where it holds none."""
    stride = int(edges[1])
    # Repeating the last value fills the last bucket without adding an extreme.
    padded = np.concatenate([values, np.full(len(edges) * stride - len(values), values[-1])])
    table = padded.reshape(len(edges), stride)
    lost = np.isnan(table)
    some = bool(lost.any())
    low = (np.where(lost, np.inf, table) if some else table).argmin(axis=1)
    high = (np.where(lost, -np.inf, table) if some else table).argmax(axis=1)
    ends = np.sort(np.stack([low, high], axis=1), axis=1)
    found = np.take_along_axis(table, ends, axis=1)
    # A bucket of one value has no second one, unless what stands there is missing.
    return np.where(np.isnan(found), found[:, ::-1], found) if some else found


def _numbers(values: Array) -> list[float | None]:
    finite = np.isfinite(values)
    largest = float(np.abs(values[finite]).max()) if finite.any() else 0.0
    digits = DIGITS - 1 - (int(np.floor(np.log10(largest))) if largest > 0 else 0)
    rounded = np.round(values, min(max(digits, 0), 12)).tolist()
    return rounded if finite.all() else [x if ok else None for x, ok in zip(rounded, finite, strict=True)]
