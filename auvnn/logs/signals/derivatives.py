"""Smoothing and differentiation by local polynomials, on even and uneven time alike.

Every sample gets the polynomial of a given order that fits the samples around it best,

    min_c sum_j (y_j - sum_k c_k (t_j - t_i)^k)^2,  j in a window of 2 half_width + 1 samples,

and c_0 is the smoothed value, c_1 the derivative (Savitzky and Golay 1964). Near the ends of a stretch
the outermost full window is used, which on even time is `scipy.signal.savgol_filter(mode="interp")`.
The filter is linear in y and depends on t alone: apply the same one to measurements and to a model's
output and their difference is free of the filter's distortion.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from auvnn.errors import ConfigError
from auvnn.logs.signals.segments import stretch_edges

Array = NDArray[np.float64]
_CHUNK = 1_000_000  # numbers per window array at a time
_KEEP = 20_000_000  # weights kept in memory at most
_EVEN = 1e-8  # steps that differ by less than this share of the median count as even


class LocalPolynomial:
    """The linear operator that smooths and differentiates signals sampled at `t`.

    Args:
        t: increasing time, s, (N,).
        half_width: samples on either side of the centre; the window has 2 half_width + 1.
        order: order of the polynomial, at most 2 half_width.
        max_gap: no window reaches across a longer step, s; five median steps where None.

    Raises:
        ConfigError: the order does not fit the window.
    """

    def __init__(
        self, t: ArrayLike, half_width: int = 4, order: int = 2, max_gap: float | None = None
    ) -> None:
        """Place a window around every sample; the weights are computed when they are first needed."""
        if half_width < 1 or not 1 <= order <= 2 * half_width:
            raise ConfigError(
                f"a local polynomial of order {order} over {2 * half_width + 1} samples does not exist: "
                "half_width must be at least 1 and order between 1 and 2 half_width"
            )
        self.t: Array = np.asarray(t, dtype=np.float64)
        self.half_width = int(half_width)
        self.order = int(order)
        self.window = 2 * self.half_width + 1
        edges = stretch_edges(self.t, max_gap) if len(self.t) else np.zeros(1, dtype=np.intp)
        self._stretches = len(edges) - 1
        first = np.repeat(edges[:-1], np.diff(edges))
        last = np.repeat(edges[1:], np.diff(edges)) - self.window
        #: first sample of each sample's window (N,)
        self.start: NDArray[np.intp] = np.clip(np.arange(len(self.t)) - self.half_width, first, None)
        self.start = np.maximum(np.minimum(self.start, last), 0)
        #: samples whose stretch is long enough for a full window (N,)
        self.full: NDArray[np.bool_] = last >= first

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        smooth = np.full((len(self.t), self.window), np.nan)
        slope = np.full_like(smooth, np.nan)
        for chunk in self._chunks():
            smooth[chunk], slope[chunk] = self._chunk_weights(chunk)
        return smooth, slope

    def _chunks(self) -> list[NDArray[np.intp]]:
        rows = np.flatnonzero(self.full)
        return np.array_split(rows, max(1, -(-len(rows) * self.window // _CHUNK)))

    def _chunk_weights(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        index = self.start[rows, None] + np.arange(self.window)
        return _fit(self.t[index] - self.t[rows, None], self.order)

    @property
    def smoothing(self) -> Array:
        """Weights (N, window) on the samples from `start` on that give the smoothed value."""
        return self._weights[0]

    @property
    def differentiating(self) -> Array:
        """Weights (N, window), 1/s, on the samples from `start` on that give the derivative."""
        return self._weights[1]

    def __call__(self, y: ArrayLike) -> tuple[Array, Array]:
        """Return the smoothed signal and its derivative.

        Args:
            y: signal (N,) or (N, k). A missing sample (NaN) makes every value whose window holds it NaN;
                so does a stretch that is shorter than the window.

        Returns:
            The smoothed signal, unit of y, and the derivative, unit of y per second, both of y's shape.
        """
        values = np.asarray(y, dtype=np.float64)
        if len(values) != len(self.t):
            raise ConfigError(f"a signal of {len(values)} samples does not fit a time of {len(self.t)}")
        flat = values.reshape(len(values), -1)
        if self._is_even and len(flat) >= self.window:
            smooth, slope = self._even(flat)
        else:
            smooth, slope = self._uneven(flat)
        return smooth.reshape(values.shape), slope.reshape(values.shape)

    @cached_property
    def _is_even(self) -> bool:
        steps = np.diff(self.t)
        if len(steps) == 0 or not self.full.all():
            return False
        middle = float(np.median(steps))
        return bool(np.abs(steps - middle).max() <= _EVEN * middle) and self._stretches == 1

    def _uneven(self, y: Array) -> tuple[Array, Array]:
        smooth, slope = np.full_like(y, np.nan), np.full_like(y, np.nan)
        # The weights are worth keeping for the next signal, but not at the price of a gigabyte.
        keep = len(self.t) * self.window <= _KEEP
        for chunk in self._chunks():
            windows = y[self.start[chunk, None] + np.arange(self.window)]
            value, rate = (w[chunk] for w in self._weights) if keep else self._chunk_weights(chunk)
            smooth[chunk] = np.einsum("nw,nwk->nk", value, windows)
            slope[chunk] = np.einsum("nw,nwk->nk", rate, windows)
        return smooth, slope

    def _even(self, y: Array) -> tuple[Array, Array]:
        # One set of weights serves all inner samples; only the two ends have their own.
        h, n, span = self.half_width, len(y), self.t[-1] - self.t[0]
        offsets = np.arange(self.window) * (span / (n - 1))
        weights, slopes = _fit(offsets[None, :] - offsets[:, None], self.order)
        smooth, slope = np.zeros_like(y), np.zeros_like(y)
        inner, head, tail = slice(h, n - h), y[: self.window], y[-self.window :]
        for j in range(self.window):
            part = y[j : n - self.window + 1 + j]
            smooth[inner] += weights[h, j] * part
            slope[inner] += slopes[h, j] * part
        smooth[:h], slope[:h] = weights[:h] @ head, slopes[:h] @ head
        smooth[n - h :], slope[n - h :] = weights[h + 1 :] @ tail, slopes[h + 1 :] @ tail
        return smooth, slope


def _fit(offsets: Array, order: int) -> tuple[Array, Array]:
    """Return weights (M, W) of value and slope at offset zero, for windows of time offsets (M, W), s.

    The polynomial is written in Legendre polynomials over the window: on nearly even time they are nearly
    orthogonal, and the normal equations lose no digits.
    """
    low, high = offsets[:, :1], offsets[:, -1:]
    scale = 0.5 * (high - low)
    basis, _ = _legendre((offsets - 0.5 * (low + high)) / scale, order)
    value, slope = _legendre(-0.5 * (low + high) / scale, order)
    wanted = np.concatenate([value, slope / scale[:, :, None]], axis=1)
    gram = np.swapaxes(basis, 1, 2) @ basis
    weights = basis @ np.linalg.solve(gram, np.swapaxes(wanted, 1, 2))
    return np.asarray(weights[:, :, 0], np.float64), np.asarray(weights[:, :, 1], np.float64)


def _legendre(x: Array, order: int) -> tuple[Array, Array]:
    """Return the Legendre polynomials up to an order and their derivatives, (..., order + 1)."""
    values, slopes = [np.ones_like(x), x], [np.zeros_like(x), np.ones_like(x)]
    for k in range(1, order):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
        slopes.append(slopes[k - 1] + (2 * k + 1) * values[k])
    return np.stack(values, axis=-1), np.stack(slopes, axis=-1)


def local_polynomial(
    t: ArrayLike, y: ArrayLike, half_width: int = 4, order: int = 2, max_gap: float | None = None
) -> tuple[Array, Array]:
    """Return the smoothed signal and its derivative by local polynomials.

    Args:
        t: increasing time, s, (N,), even or not.
        y: signal, (N,) or (N, k); NaN is missing.
        half_width: samples on either side of the centre.
        order: order of the polynomial.
        max_gap: no window reaches across a longer step, s; five median steps where None.

    Returns:
        Smoothed signal (unit of y) and derivative (unit of y per second), of y's shape.
    """
    return LocalPolynomial(t, half_width, order, max_gap)(y)


def response(frequency: ArrayLike, dt: float, half_width: int = 4, order: int = 2) -> tuple[Array, Array]:
    """Return the gain of the filter on even time, relative to a perfect one.

    Args:
        frequency: Hz, (F,).
        dt: time step, s.
        half_width: samples on either side of the centre.
        order: order of the polynomial.

    Returns:
        Gain of the smoothed value, H(f), and of the derivative divided by 2 pi f, both (F,); both are
        1 at zero frequency and are signed.
    """
    offsets: Array = np.arange(-half_width, half_width + 1, dtype=np.float64) * float(dt)
    weights, slopes = _fit(offsets[None, :], order)
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
    value = (weights * np.cos(omega * offsets)).sum(axis=1)
    # sin(w x)/w = x sinc(w x/pi) stays finite at w = 0
    slope = (slopes * offsets * np.sinc(omega * offsets / np.pi)).sum(axis=1)
    return value, slope


def bandwidth_hz(
    dt: float, half_width: int = 4, order: int = 2, of: Literal["derivative", "value"] = "derivative"
) -> float:
    """Return the frequency at which the filter's gain first falls by 3 dB, Hz; Nyquist if it never does.

    Args:
        dt: time step, s.
        half_width: samples on either side of the centre.
        order: order of the polynomial.
        of: "derivative" for the gain relative to a perfect differentiator, "value" for the smoothed value.
    """
    nyquist = 0.5 / dt
    low, high = 0.0, nyquist
    which = 1 if of == "derivative" else 0
    for _ in range(3):
        grid = np.linspace(low, high, 2001)
        below = np.flatnonzero(response(grid, dt, half_width, order)[which] < np.sqrt(0.5))
        if len(below) == 0:
            return nyquist
        low, high = grid[max(below[0] - 1, 0)], grid[below[0]]
    return float(0.5 * (low + high))


def noise_gain(dt: float, half_width: int = 4, order: int = 2) -> tuple[float, float]:
    """Return the standard deviations that white noise of unit standard deviation leaves behind.

    Args:
        dt: time step, s.
        half_width: samples on either side of the centre.
        order: order of the polynomial.

    Returns:
        Of the smoothed value (a pure number) and of the derivative (1/s), away from the ends.
    """
    offsets: Array = np.arange(-half_width, half_width + 1, dtype=np.float64) * float(dt)
    weights, slopes = _fit(offsets[None, :], order)
    return float(np.linalg.norm(weights)), float(np.linalg.norm(slopes))
