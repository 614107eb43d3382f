"""How late one signal is against another, by cross-correlation, with an interval.

The lag is where the correlation of x(t) with y(t + lag) is largest in size, a parabola through the three shifts
around it giving the part of a sample. Its uncertainty comes from the record itself: blocks of it are left out in
turn (jackknife), and the interval is Student's with one degree of freedom less than there are blocks.
Reference: Knapp and Carter (1976), IEEE Trans. ASSP 24(4); Efron and Tibshirani (1993), chapter 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

Array = NDArray[np.float64]

_BLOCK_SECONDS = 10.0
_MOST_BLOCKS = 24
_ROUGH = 0.05  # of a step: what the parabola itself may be off
_OWN = 0.7  # correlation from which a block's own lag is believed
_DRIFT_T, _DRIFT = 4.0, 0.05  # Student's t and s over the record from which a drift is spoken of
_OTHER = 0.7  # correlation at which another clock is believed
_RIVAL = 0.85  # of it that no other offset may reach


@dataclass(frozen=True)
class Lag:
    """A lag and how well it is known.

    Args:
        value: by how much the second signal is late, s.
        low: lower end of the 95 % interval, s; NaN where the record is too short for one.
        high: upper end, s.
        correlation: at that lag.
        drift: change of the lag per second, where it changes beyond doubt, else 0.
    """

    value: float
    low: float = float("nan")
    high: float = float("nan")
    correlation: float = float("nan")
    drift: float = 0.0

    @property
    def std(self) -> float:
        """Half the interval over 1.96: what to weigh it by, s."""
        return (self.high - self.low) / 3.92


def estimate(signals: Sequence[tuple[Array, Array]], dt: float, reach: float = 1.0) -> Lag:
    """Return by how much y is late against x, of all runs together.

    Args:
        signals: x and y of each run, (N,) at equal steps; NaN is missing.
        dt: step, s.
        reach: lags up to this are looked at, s.
    """
    width = int(np.clip(round(reach / dt), 1, 100))
    shifts = np.arange(-width, width + 1)
    parts, middles = [], []
    begun = 0.0
    for x, y in signals:
        sums, middle = _sums(_centred(x), _centred(y), shifts, dt)
        parts.append(sums)
        middles.append(begun + middle)
        begun += len(x) * dt
    sums, middle = np.concatenate(parts, axis=1), np.concatenate(middles)
    whole, at = _peak(sums.sum(1, keepdims=True), shifts)
    value = float(whole[0] * dt)
    blocks = sums.shape[1]
    if blocks < 3:
        return Lag(value, correlation=float(at[0]))
    without, _ = _peak(sums.sum(1, keepdims=True) - sums, shifts)
    variance = (blocks - 1) / blocks * float(((without - without.mean()) ** 2).sum()) + _ROUGH**2
    reach95 = float(student.ppf(0.975, blocks - 1)) * np.sqrt(variance) * dt
    own, strength = _peak(sums, shifts)
    return Lag(
        value, value - reach95, value + reach95, float(at[0]), _drift(middle, own * dt, strength > _OWN)
    )


def _centred(x: Array) -> Array:
    """Return x without its mean, zero where it is missing."""
    good = np.isfinite(x)
    return np.where(good, x - x[good].mean(), 0.0) if good.any() else np.zeros_like(x)


def _sums(x: Array, y: Array, shifts: NDArray[np.intp], dt: float) -> tuple[Array, Array]:
    """Return xy, xx, yy by block and shift, (3, blocks, shifts), and the middle of each block, s."""
    n, width = len(x), int(shifts[-1])
    count = int(np.clip(n * dt / _BLOCK_SECONDS, 1, _MOST_BLOCKS))
    edges = np.linspace(0, n, count + 1).astype(int)
    padded = np.concatenate([np.zeros(width), y, np.zeros(width)])
    present = np.concatenate([np.zeros(width), (y != 0.0).astype(float), np.zeros(width)])
    seen = (x != 0.0).astype(float)
    out = np.empty((3, count, len(shifts)))
    for i in range(len(shifts)):
        moved, there = padded[i : i + n], present[i : i + n]
        for row, product in enumerate((x * moved, x * x * there, moved * moved * seen)):
            out[row, :, i] = np.add.reduceat(product, edges[:-1])
    return out, dt * 0.5 * (edges[1:] + edges[:-1])


def _peak(sums: Array, shifts: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the shift of the largest correlation in size, in steps, and that size, (K,) of sums (3, K, S)."""
    xy, xx, yy = sums
    scale = np.sqrt(np.maximum(xx * yy, 0.0))
    strength = np.abs(xy) / np.where(scale > 0.0, scale, np.inf)
    best = strength.argmax(1)
    rows = np.arange(len(best))
    inner = np.clip(best, 1, len(shifts) - 2)
    left, middle, right = (strength[rows, inner + k] for k in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    fine = (best == inner) & (bend < 0.0)
    part = np.where(fine, 0.5 * (left - right) / np.where(fine, bend, 1.0), 0.0)
    return np.asarray(shifts[best] + part, dtype=np.float64), strength[rows, best]


def _drift(when: Array, lag: Array, good: NDArray[np.bool_]) -> float:
    when, lag = when[good], lag[good]
    if len(when) < 6:
        return 0.0
    x = when - when.mean()
    slope = float(x @ lag / (x @ x))
    left = lag - lag.mean() - slope * x
    error = float(np.sqrt((left @ left + len(x) * 1e-8) / (len(x) - 2) / (x @ x)))
    clear = abs(slope) > _DRIFT_T * error and abs(slope) * (when[-1] - when[0]) > _DRIFT
    return slope if clear else 0.0


def together(found: Sequence[Lag]) -> Lag:
    """Return one lag of several channels of one sensor, weighed by their intervals; signs of the others agree."""
    known = [lag for lag in found if np.isfinite(lag.low)]
    if not known:
        return found[0]
    weight = np.array([1.0 / max(lag.std, 1e-6) ** 2 for lag in known])
    values = np.array([lag.value for lag in known])
    value = float(weight @ values / weight.sum())
    # Channels that disagree by more than their intervals widen the common one.
    excess = max(1.0, float(weight @ (values - value) ** 2) / max(len(known) - 1, 1))
    half = 1.96 * float(np.sqrt(excess / weight.sum()))
    drifts = [lag.drift for lag in known if lag.drift]
    return Lag(
        value,
        value - half,
        value + half,
        float(np.mean([lag.correlation for lag in known])),
        float(np.median(drifts)) if len(drifts) == len(known) else 0.0,
    )


def other_clock(pairs: Sequence[tuple[Array, Array]], dt: float, longest: float) -> Lag | None:
    """Return the one offset at which two sensors' channels agree that do not as they are stamped, or None.

    Args:
        pairs: of each run x (N, k) and y (N, k) at equal steps, the same channels from two sensors.
        dt: step, s.
        longest: offsets up to this are looked at, s.
    """
    reach = min(int(longest / dt), min(len(x) for x, _ in pairs) // 2)
    if reach < 2:
        return None
    shifts = np.arange(-reach, reach + 1)
    total = np.zeros(len(shifts))
    for x, y in pairs:
        size = 1 << int(np.ceil(np.log2(2 * len(x))))
        for a, b in zip(x.T, y.T, strict=True):
            a, b = _centred(a), _centred(b)
            scale = np.sqrt(float(a @ a) * float(b @ b))
            if scale == 0.0:
                continue
            raw = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
            overlap = (len(a) - np.abs(shifts)) / len(a)
            total += raw[shifts % size] / scale / overlap
    total /= sum(x.shape[1] for x, _ in pairs)
    best = int(total.argmax())
    away = np.abs(shifts - shifts[best]) > 1.0 / dt
    if total[best] < _OTHER or (away.any() and total[away].max() > _RIVAL * total[best]):
        return None
    offset = int(shifts[best])
    moved = []
    for x, y in pairs:
        a, b = (x[: len(x) - offset], y[offset:]) if offset >= 0 else (x[-offset:], y[:offset])
        moved += [(a[:, i], b[:, i]) for i in range(x.shape[1])]
    fine = estimate(moved, dt)
    return Lag(
        fine.value + offset * dt,
        fine.low + offset * dt,
        fine.high + offset * dt,
        fine.correlation,
        fine.drift,
    )
