"""Long records made short enough to draw, without losing a peak or a gap."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
LIMIT = 1600


def gaps(t: ArrayLike, factor: float = 5.0) -> NDArray[np.intp]:
    """Return the indices after which time jumps by more than `factor` median steps (or backwards)."""
    step = np.diff(np.asarray(t, dtype=float))
    good = step[np.isfinite(step) & (step > 0)]
    if not good.size:
        return np.zeros(0, dtype=np.intp)
    return np.flatnonzero(~((step > 0) & (step <= factor * np.median(good))))


def decimate(t: ArrayLike, y: ArrayLike, limit: int = LIMIT) -> tuple[Floats, Floats]:
    """Return at most `limit` points of y(t) that look like all of them.

    Each bucket of samples gives its smallest and its largest value in the order in which they occurred, so
    no spike is lost. Samples without a value are left out; where more than five median steps lie between two
    values, the line is broken by a NaN.

    Args:
        t: time, s, (N,).
        y: values, (N,), NaN where missing.
        limit: the most points to return, at least 16.
    """
    t, y = np.asarray(t, dtype=float).ravel(), np.asarray(y, dtype=float).ravel()
    n = min(t.size, y.size)
    good = np.isfinite(y[:n]) & np.isfinite(t[:n])
    t, y = t[:n][good], y[:n][good]
    limit = max(int(limit), 16)
    breaks = gaps(t)
    if breaks.size > limit // 4:  # keep the widest
        width = np.abs(t[breaks + 1] - t[breaks])
        breaks = np.sort(breaks[np.argsort(-width, kind="stable")[: limit // 4]])
    whole = t.size + breaks.size <= limit
    index = np.arange(t.size) if whole else _extremes(y, (limit - breaks.size) // 2 - 1)
    place = np.unique(np.searchsorted(index, breaks, side="right"))
    place = place[(place > 0) & (place < index.size)]
    return np.insert(t[index], place, t[index][place]), np.insert(y[index], place, np.nan)


def _extremes(y: Floats, buckets: int) -> NDArray[np.intp]:
    size = -(-y.size // buckets)
    # Repeating the last value fills the last bucket without adding an extreme.
    table = np.concatenate([y, np.full(size * buckets - y.size, y[-1])]).reshape(buckets, size)
    ends = np.stack([table.argmin(axis=1), table.argmax(axis=1)], axis=1)
    index = np.arange(buckets)[:, None] * size + np.sort(ends, axis=1)
    return np.unique(np.minimum(np.concatenate([[0], index.ravel(), [y.size - 1]]), y.size - 1))


def telling_window(t: ArrayLike, measured: ArrayLike, model: ArrayLike, length: float) -> slice:
    """Return the samples of the `length` seconds in which the model errs most.

    The error is squared, each channel in units of its own spread, summed over the channels; missing values
    count nothing. A record that is not longer comes back whole.

    Args:
        t: time, s, (N,).
        measured: (N, k), NaN where missing.
        model: (N, k), NaN where it did not run.
        length: of the window, s.
    """
    t = np.asarray(t, dtype=float).ravel()
    measured, model = np.asarray(measured, dtype=float), np.asarray(model, dtype=float)
    n = min(t.size, len(measured), len(model))
    if n < 3 or not np.isfinite(t[:n]).all() or t[n - 1] - t[0] <= length:
        return slice(0, n)
    with np.errstate(all="ignore"):
        spread = np.sqrt(np.mean(np.nan_to_num(measured[:n] - _mean(measured[:n])) ** 2, axis=0))
        error = (model[:n] - measured[:n]) / np.where(spread > 0, spread, np.inf)
    # A diverged model must not outweigh everything else by powers of ten.
    square = np.minimum(np.nan_to_num(error, nan=0.0, posinf=10.0, neginf=10.0) ** 2, 100.0).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(square)])
    stop = np.searchsorted(t[:n], t[:n] + length, side="right")
    start = np.arange(n)
    whole = t[:n] <= t[n - 1] - length
    score = np.where(whole, total[stop] - total[start], -1.0)
    best = int(np.argmax(score))
    return slice(best, int(stop[best]))


def _mean(y: Floats) -> Floats:
    good = np.isfinite(y)
    return np.where(good, y, 0.0).sum(axis=0) / np.maximum(good.sum(axis=0), 1)
