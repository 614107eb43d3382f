"""By how much correlation between windows multiplies the variance of a score."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


# Shares of a parameter's information below this are rounding.
TINY = 1e-10


def variance_inflation(by_window: Array, information: Array, run: NDArray[np.int64], spent: int = 1) -> float:
    """Return how much more the scores vary from window to window than white noise would have it, at least one.

    Neighbouring windows of a run count with Bartlett's weight of one half.

    Args:
        by_window: scores (B, p).
        information: (p, p) of all windows.
        run: run of each window (B,).
        spent: degrees of freedom that have gone into the scores' mean.
    """
    centred = by_window - by_window.mean(0)
    spread = centred.T @ centred
    next_to = run[1:] == run[:-1]
    lagged = centred[1:][next_to].T @ centred[:-1][next_to]
    return ratio(spread + 0.5 * (lagged + lagged.T), information, len(by_window), spent)


def ratio(spread: Array, information: Array, count: int, spent: int = 1) -> float:
    """Return how much larger the scores' spread is than white noise would have it, at least one.

    Args:
        spread: sum of the products of the windows' centred scores, neighbours included, (p, p).
        information: (p, p) of all windows.
        count: windows.
        spent: degrees of freedom that have gone into the scores' mean.
    """
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values.max(initial=0.0), 1e-300)
    if not keep.any():
        return 1.0
    white = vectors[:, keep] / np.sqrt(values[keep])
    size = np.trace(white.T @ spread @ white) / keep.sum() * count / max(count - spent, 1)
    return float(max(1.0, size))
