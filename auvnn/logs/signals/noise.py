"""How much white noise a channel carries, told from its motion by differences of high order."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from auvnn.logs.signals.segments import default_gap

Array = NDArray[np.float64]
_ORDER = 6
_MIN_CONTRASTS = 8
_LONG = 200_000  # samples; of more, evenly spread blocks are enough
_BLOCKS, _BLOCK = 20, 5_000
_EVEN = 1e-9
_NORMAL = 0.6744897501960817  # median of |x| for a standard normal x


def noise_std(t: ArrayLike, y: ArrayLike) -> Array | float:
    """Return the standard deviation of the white noise in each channel.

    Every seven consecutive samples give one contrast, the divided difference of sixth order scaled to unit
    variance under unit white noise,

        e_i = sum_j c_j y_{i+j} / |c|,  c_j = prod_{m != j} 1 / (t_{i+j} - t_{i+m}),

    which a motion that is a polynomial of order five over those samples leaves at zero; the estimate is
    median |e| / 0.6745, so that steps and spikes do not count.

    Bias: a motion A sin(w t) adds up to A (2 sin(w dt / 2))^6 / 30.4, that is 0.003 % of A at twenty
    samples per period, 0.2 % at ten and 2 % at six; noise that a filter has coloured is underestimated;
    quantization in steps of q counts as about q / 3.5. Repeated values (sample and hold) are left out
    first, because a held sample is no second measurement. Of more than 200 000 samples twenty blocks of
    5000 are used.

    Args:
        t: increasing time, s, (N,), even or not.
        y: signals, (N,) or (N, k); NaN is missing.

    Returns:
        (k,), or a number for (N,); NaN where fewer than eight contrasts can be formed.
    """
    time, values = np.asarray(t, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if values.ndim == 1:
        return _blocks(time, values)
    return np.array([_blocks(time, column) for column in values.T])


def _blocks(t: Array, y: Array) -> float:
    if len(t) <= _LONG:
        return _channel(t, y)
    starts = np.linspace(0, len(t) - _BLOCK, _BLOCKS).astype(int)
    parts = [_channel(t[s : s + _BLOCK], y[s : s + _BLOCK]) for s in starts]
    finite = [part for part in parts if np.isfinite(part)]
    return float(np.median(finite)) if finite else float("nan")


def _channel(t: Array, y: Array) -> float:
    good = np.isfinite(y)
    if good.any() and np.ptp(y[good]) == 0.0:
        return 0.0
    fresh = good.copy()
    fresh[1:] &= ~(good[:-1] & (y[1:] == y[:-1]))
    # Repeats that are rare are chance or quantization, and dropping them would bias the estimate.
    keep = fresh if fresh.sum() < 0.95 * good.sum() else good
    limit = default_gap(t) * max(1.0, good.sum() / max(keep.sum(), 1))
    t, y = t[keep], y[keep]
    if len(t) < _ORDER + _MIN_CONTRASTS:
        return float("nan")
    e = _contrasts(t, y, limit)
    return float(np.median(np.abs(e)) / _NORMAL) if len(e) >= _MIN_CONTRASTS else float("nan")


def _contrasts(t: Array, y: Array, limit: float) -> Array:
    n = len(t) - _ORDER
    unbroken = np.ones(n, dtype=bool)
    steps = np.diff(t)
    for j in range(_ORDER):
        unbroken &= steps[j : j + n] <= limit
    scale = float(np.median(steps))
    even = np.abs(steps - scale).max() <= _EVEN * scale
    # On even time every window has the same weights.
    windows = 1 if even else n
    weights = np.empty((_ORDER + 1, windows))
    for j in range(_ORDER + 1):
        product = np.ones(windows)
        for m in range(_ORDER + 1):
            if m != j:
                product *= (t[j : j + windows] - t[m : m + windows]) / scale
        weights[j] = 1.0 / product
    weights /= np.linalg.norm(weights, axis=0)
    # Subtracting the centre keeps round-off of a large offset (a depth, a heading) out of the estimate.
    centre = y[_ORDER // 2 : _ORDER // 2 + n]
    e = sum(weights[j] * (y[j : j + n] - centre) for j in range(_ORDER + 1))
    return np.asarray(e)[unbroken]
