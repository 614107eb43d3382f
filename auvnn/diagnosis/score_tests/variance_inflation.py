"""By how much correlation between windows multiplies the variance of a score."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    white: Array | None = None,
) -> float:
    """Return how much more the scores vary from window to window than white noise would have it, at least one.

    Neighbouring windows of a run count with Bartlett's weight of one half.

    Args:
        by_window: scores (B, p).
        information: (p, p) of all windows.
        run: run of each window (B,).
        spent: degrees of freedom that have gone into the scores' mean.
        white: the spread that white noise would leave, (p, p), see `white_spread`; where None, all of the information but
            the share of `spent` windows, which is enough whatever the fit has taken.
    """
    centred = by_window - by_window.mean(0)
    spread = centred.T @ centred
    next_to = run[1:] == run[:-1]
    lagged = centred[1:][next_to].T @ centred[:-1][next_to]
    seen = spread + 0.5 * (lagged + lagged.T)
    if white is None:
        return ratio(seen, information, len(by_window), spent)
    kept = ratio(white, information, 1, 0, least=LEAST)
    return max(1.0, ratio(seen, information, 1, 0, least=0.0) / kept)


def white_spread(by_itself: Array, information: Array, run: NDArray[np.int64]) -> Array:
    """Return the spread of the windows' scores that white noise leaves when what an effect explains is taken out, (p, p).

    With scores s_b of covariance P_b, the fit takes P_b G s from each, s being their sum and G the inverse of the
    information: what is left of windows b and c goes together by P_b, if they are one, less P_b G P_c.

    Args:
        by_itself: information of each window, P_b, (B, p, p).
        information: of all windows, (p, p).
        run: run of each window, (B,).
    """
    inverse = np.linalg.pinv(information, rcond=TINY, hermitian=True)
    taken = by_itself @ inverse
    alone = (by_itself - taken @ by_itself).sum(0)
    next_to = run[1:] == run[:-1]
    lagged = -(taken[1:][next_to] @ by_itself[:-1][next_to]).sum(0)
    return alone + 0.5 * (lagged + lagged.T)


def ratio(spread: Array, information: Array, count: int, spent: int = 1, least: float = 1.0) -> float:
    """Return how much larger the scores' spread is than white noise would have it, at least one.

    Args:
        spread: sum of the products of the windows' centred scores, neighbours included, (p, p).
        information: (p, p) of all windows.
        count: windows.
        spent: degrees of freedom that have gone into the scores' mean.
        least: that is returned.
    """
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values.max(initial=0.0), 1e-300)
    if not keep.any():
        return 1.0
    white = vectors[:, keep] / np.sqrt(values[keep])
    size = np.trace(white.T @ spread @ white) / keep.sum() * count / max(count - spent, 1)
    return float(max(least, size))
