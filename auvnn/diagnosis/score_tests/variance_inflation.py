"""By how much correlation between windows multiplies the variance of a score."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.estimation.window_sums.sufficient_statistics import ScoreMoments

Array = NDArray[np.float64]
# Shares of a parameter's information below this are rounding.
TINY = 1e-10
# Share of what white noise would show that is left by a fit, below which nothing is told of the noise any more.
LEAST = 0.1


def variance_inflation(
    by_window: Array,
    information: Array,
    run: NDArray[np.int64],
    spent: int = 1,
    left: float | None = None,
) -> float:
    """Return how much more the scores vary from window to window than white noise would have it, at least one.

    Neighbouring windows of a run count with Bartlett's weight of one half.

    Args:
        by_window: scores (B, p).
        information: (p, p) of all windows.
        run: run of each window (B,).
        spent: degrees of freedom that have gone into the scores' mean.
        left: share of the spread of white noise that is left in the scores, see `share_left`; where None, all of it but
            the share of `spent` windows, which is enough whatever the fit has taken.
    """
    return inflation(ScoreMoments.of(by_window, run).spread(), information, len(by_window), spent, left)


def inflation(
    spread: Array, information: Array, count: int, spent: int = 1, left: float | None = None
) -> float:
    """Return what `variance_inflation` does, from the spread of the scores.

    Args:
        spread: sum of the products of the windows' centred scores, neighbours included, (p, p).
        information: (p, p) of all windows.
        count: windows.
        spent: degrees of freedom that have gone into the scores' mean.
        left: see `variance_inflation`.
    """
    if left is None:
        return ratio(spread, information, count, spent)
    return max(1.0, ratio(spread, information, 1, 0, least=0.0) / max(left, LEAST))


def inverse_root(information: Array) -> Array:
    """Return R, (p, r), with R R^T the inverse of the information, (p, p), where it holds anything."""
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values.max(initial=0.0), 1e-300)
    return vectors[:, keep] / np.sqrt(values[keep])


def share_left(shares: ScoreMoments, rank: int) -> float:
    """Return the share of the spread of white noise that is left when what an effect explains is taken out.

    With scores s_b of covariance P_b, the fit takes P_b G s from each, s being their sum and G = R R^T the inverse of
    the information. What is left of windows b and c has the covariance P_b, if they are one, less P_b G P_c; in units of
    the information its trace is that of A_b = R^T P_b R less that of A_b A_c.

    Args:
        shares: moments of the windows' A_b, see `InformationShares`.
        rank: r, the trace of the sum of all A_b.
    """
    return float(1.0 - (np.trace(shares.square) + np.trace(shares.lagged)) / max(rank, 1))


def ratio(spread: Array, information: Array, count: int, spent: int = 1, least: float = 1.0) -> float:
    """Return how much larger the scores' spread is than white noise would have it, at least one.

    Args:
        spread: sum of the products of the windows' centred scores, neighbours included, (p, p).
        information: (p, p) of all windows.
        count: windows.
        spent: degrees of freedom that have gone into the scores' mean.
        least: what is returned at least.
    """
    white = inverse_root(information)
    rank = white.shape[1]
    if not rank:
        return 1.0
    size = np.trace(white.T @ spread @ white) / rank * count / max(count - spent, 1)
    return float(max(least, size))
