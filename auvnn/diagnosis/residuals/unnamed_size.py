"""How large a force without a name is: its root mean square, an upper limit, and the smallest that would have shown.

The force is the one of `variance_component`: in every window a Fourier series of its own, whose coefficients are
independent normal ones with a common variance v in each degree of freedom. The variance is that of the largest marginal
likelihood. Its upper limit is the one at which twice the logarithm has fallen by 2.71, which is exceeded in one of
twenty logs (Wilks 1938, Annals of Mathematical Statistics 9(1) 60-62). With a mean and K pairs of sine and cosine of
variance v each, the mean square over a window is v (1 + K).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

AXES = ("X", "Y", "Z", "K", "M", "N")
Array = NDArray[np.float64]
# Variances of the coefficients that are tried, in plausible sizes squared, and by how much twice the logarithm of the
# likelihood falls at a limit that holds 95 % on one side.
GRID = np.concatenate([[0.0], np.logspace(-10.0, 4.0, 141)])
FALL = float(norm.isf(0.05) ** 2)
# What the smallest force that would have shown must reach: the level of the test, for six degrees of freedom, and how
# often.
LEVEL, POWER = 0.001 / 6.0, 0.95


@dataclass(frozen=True)
class Size:
    """How large the force in one degree of freedom is.

    Attributes:
        rms: N or N m.
        upper: its upper 95 % limit.
        detectable: the smallest that this log would have shown in 95 of 100 cases.
        correlation_time: s, of the force; None where there is none, or it lasts longer than a window.
    """

    rms: float
    upper: float
    detectable: float
    correlation_time: float | None


def sizes(slope: Array, hessian: Array, found: list[str], unit: Array, period: float) -> dict[str, Size]:
    """Return how large the force is in each degree of freedom, what acts elsewhere taken out first.

    Args:
        slope: (W, 6 K), J^T e of each window, in units of the coefficients' plausible sizes.
        hessian: (W, 6 K, 6 K), J^T J.
        found: degrees of freedom in which a force acts, the surest first; the others follow.
        unit: (6,) these sizes, N and N m.
        period: of the series, s.
    """
    count = slope.shape[1] // 6
    order = [*found, *(a for a in AXES if a not in found)]
    out: dict[str, Size] = {}
    for axis in order:
        i = AXES.index(axis)
        own = np.arange(count) + i * count
        block = 0.5 * (hessian[:, own[:, None], own] + hessian[:, own[:, None], own].transpose(0, 2, 1))
        values, vectors = np.linalg.eigh(block)
        values = np.maximum(values, 0.0)
        along = np.einsum("wij,wi->wj", vectors, slope[:, own])
        likelihood = _likelihood(values, along)
        best = int(likelihood.argmax())
        over = np.flatnonzero(
            (2.0 * (likelihood[best] - likelihood) <= FALL) & (np.arange(len(GRID)) >= best)
        )
        scale = float(unit[i]) * np.sqrt(1.0 + (count - 1) / 2.0)
        variance = float(GRID[best])
        information = float(values.sum())
        out[axis] = Size(
            scale * np.sqrt(variance),
            scale * np.sqrt(float(GRID[min(int(over[-1]) + 1, len(GRID) - 1)]))
            if information > 0
            else np.inf,
            scale * np.sqrt(_least(values)),
            _correlation_time(values, vectors, along, variance, period) if axis in found else None,
        )
        if axis in found and variance > 0.0:
            # What acts here shows elsewhere too: that share is not another force.
            slope, hessian = taken_out(slope, hessian, own, block + np.eye(count) / variance)
    return out


def taken_out(slope: Array, hessian: Array, own: NDArray[np.int64], inner: Array) -> tuple[Array, Array]:
    """Return the sums of every window without what a force explains in them, or could have explained.

    Args:
        slope: J^T e, (W, P).
        hessian: J^T J, (W, P, P).
        own: the force's columns, K of them.
        inner: J^T J of these columns and the precision of their coefficients, (W, K, K).
    """
    across = hessian[:, :, own]
    solved = np.linalg.solve(inner, np.concatenate([slope[:, own, None], across.transpose(0, 2, 1)], axis=2))
    return slope - (across @ solved[:, :, :1])[..., 0], hessian - across @ solved[:, :, 1:]


def _least(values: Array) -> float:
    """Return the smallest variance that the sum of squared slopes shows, infinite where none does.

    That sum has the mean sum h (1 + v h) and the variance 2 sum h^2 (1 + v h)^2, h the eigenvalues of the information.
    """
    squared = float((values**2).sum())
    if squared <= 0.0:
        return np.inf
    chance = norm.isf(LEVEL) * np.sqrt(2.0 * squared)
    for variance in GRID[1:]:
        spread = np.sqrt(2.0 * float((values**2 * (1.0 + variance * values) ** 2).sum()))
        if variance * squared >= chance + norm.isf(1.0 - POWER) * spread:
            return float(variance)
    return np.inf


def _likelihood(values: Array, along: Array) -> Array:
    """Return the logarithm of the marginal likelihood over that without a force, at each variance of the grid."""
    out = np.zeros(len(GRID))
    for k, variance in enumerate(GRID):
        spread = variance * values
        out[k] = 0.5 * float((along**2 * variance / (1.0 + spread) - np.log1p(spread)).sum())
    return out


def _correlation_time(
    values: Array, vectors: Array, along: Array, variance: float, period: float
) -> float | None:
    """Return 1 / (2 pi f), f the root mean square frequency of the force, s; None where it outlasts the windows."""
    if variance <= 0.0:
        return None
    gain = variance / (1.0 + variance * values)
    mean = np.einsum("wij,wj->wi", vectors, gain * along)
    # What noise alone would leave in them is no part of the force.
    chance = np.einsum("wij,wj->wi", vectors**2, gain**2 * values).mean(0)
    power = np.maximum((mean**2).mean(0) - chance, 0.0)
    harmonics = (len(power) - 1) // 2
    pairs = 0.5 * (power[1 : 1 + harmonics] + power[1 + harmonics :])
    multiple = np.arange(1, harmonics + 1)
    square = float((multiple**2 * pairs).sum() / max(float(power[0] + pairs.sum()), 1e-300))
    time = period / (2.0 * np.pi * np.sqrt(square)) if square > 0 else np.inf
    return float(time) if time < period else None
