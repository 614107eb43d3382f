"""Linear fits to accelerations: weights of outliers, priors, what is left out, and the uncertainty of a gain.

Reference: Huber (1964), Annals of Mathematical Statistics 35(1), for the weights; Kuensch (1989), Annals of Statistics
17(3), for blocks of neighbouring samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.logs import Log

Array = NDArray[np.float64]

FIFTHS = 5
BLOCK = 5.0
"""Neighbouring samples of so many seconds count as one when a gain's uncertainty is judged."""
ROUNDS = 3
# Errors beyond this many robust standard deviations count in proportion to their size and not to its square.
OUTLYING = 3.0


def solve(gap: Array, x: Array, precision: Array, weight: Array, mean: Array) -> Array:
    """Return the parameters' departures that fit the gap best within their priors, (P,).

    minimises sum_ni w_ni (gap_ni - x_ni theta)^2 + sum_p precision_p (theta_p - mean_p)^2

    Args:
        gap: (N, 6).
        x: slopes, (N, 6, P).
        precision: of the priors, (P,).
        weight: (N, 6).
        mean: of the priors, (P,).
    """
    return _solved(*_sums(gap, x, weight), precision, mean)


def _sums(gap: Array, x: Array, weight: Array) -> tuple[Array, Array]:
    flat, w = x.reshape(gap.size, x.shape[-1]), weight.ravel()
    heavy = flat * w[:, None]
    return heavy.T @ flat, heavy.T @ gap.ravel()


def _solved(square: Array, right: Array, precision: Array, mean: Array) -> Array:
    if not len(right):
        return np.zeros(0)
    return NormalEquations.with_priors(square, right, precision, -mean).solve(rcond=1e-13)


def weights(gap: Array, x: Array, precision: Array, mean: Array) -> Array:
    """Return weights (N, 6) by which each degree of freedom counts alike and outliers count little.

    Args:
        gap: measured minus predicted acceleration, (N, 6).
        x: its slopes in the parameters, (N, 6, P).
        precision: of the priors, (P,).
        mean: of the priors, (P,).
    """
    weight = np.ones_like(gap) / np.maximum((gap**2).mean(0), 1e-300)
    for _ in range(ROUNDS):
        left = gap - x @ solve(gap, x, precision, weight, mean) if x.shape[-1] else gap
        sigma = 1.4826 * np.median(np.abs(left), axis=0) + 1e-12
        weight = 1.0 / np.maximum(1.0, np.abs(left) / (OUTLYING * sigma)) / sigma**2
    return weight


def left_out(
    gap: Array, x: Array, precision: Array, mean: Array, weight: Array, fifth: NDArray[np.int64]
) -> Array:
    """Return each sample's weighted squared error by the fit on the other fifths, (N,).

    Args:
        gap: measured minus predicted acceleration, (N, 6).
        x: its slopes in the parameters, (N, 6, P).
        precision: of the priors, (P,).
        mean: of the priors, (P,).
        weight: of each sample and degree of freedom, (N, 6).
        fifth: number of the fifth to which a sample belongs, (N,).
    """
    out = np.zeros(len(gap))
    held = [fifth == k for k in range(FIFTHS)]
    sums = [_sums(gap[h], x[h], weight[h]) for h in held]
    square, right = (np.sum([s[k] for s in sums], axis=0) for k in (0, 1))
    for h, (own_square, own_right) in zip(held, sums, strict=True):
        if h.all():
            own_square, own_right = np.zeros_like(own_square), np.zeros_like(own_right)
        if h.any():
            theta = _solved(square - own_square, right - own_right, precision, mean)
            out[h] = (weight[h] * (gap[h] - x[h] @ theta) ** 2).sum(1)
    return out


@dataclass(frozen=True)
class Linear:
    """What a fit is linear about.

    Attributes:
        rows: samples that count, (N,).
        gap: of these, measured minus predicted acceleration, (n, 6).
        slopes: (n, 6, P).
        precision: of the priors, (P,).
        mean: of the priors, (P,).
    """

    rows: NDArray[np.bool_]
    gap: Array
    slopes: Array
    precision: Array
    mean: Array

    def after(self, weight: Array, fifth: NDArray[np.int64]) -> Array:
        """Return each sample's weighted squared error by the fit on the other fifths, (N,); NaN where it does not count.

        Args:
            weight: of each sample and degree of freedom, (N, 6).
            fifth: number of the fifth to which a sample belongs, (N,).
        """
        out, rows = np.full(len(self.rows), np.nan), self.rows
        out[rows] = left_out(self.gap, self.slopes, self.precision, self.mean, weight[rows], fifth[rows])
        return out


def parts(log: Log) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return block and fifth of each sample, (N,): fifths of every run's own time."""
    blocks, fifths, first = [], [], 0
    for run in log.runs:
        since = run.t - run.t[0]
        own = (since / BLOCK).astype(int)
        blocks.append(first + own)
        fifths.append(np.minimum(FIFTHS * since / max(run.duration, 1e-9), FIFTHS - 1).astype(int))
        first += int(own.max()) + 1
    return np.concatenate(blocks), np.concatenate(fifths)


def standard_error(difference: Array, block: NDArray[np.int64]) -> float:
    """Return the standard error of a mean over samples of which those of one block count as one."""
    _, index = np.unique(block, return_inverse=True)
    sums = np.bincount(index, difference)
    return float(np.sqrt(len(sums)) * sums.std(ddof=1)) / len(difference) if len(sums) > 1 else float("inf")
