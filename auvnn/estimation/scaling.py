"""Units in which a symmetric matrix of sums has ones on its diagonal: rounding then spares what is hardly known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TINY = 1e-300


def unit_of(square: Array) -> Array:
    """Return one over the root of each diagonal element, (P,), and zero where there is none.

    Sums that say nothing of a parameter, or less than nothing because a window of enormous errors has rounded them away,
    must not blow it up: multiplied by zero it drops out, and no step is taken in it.

    Args:
        square: (P, P), symmetric.
    """
    diagonal = np.diag(square)
    with np.errstate(invalid="ignore"):
        alive = np.isfinite(diagonal) & (diagonal > TINY)
    return np.where(alive, 1.0 / np.sqrt(np.where(alive, diagonal, 1.0)), 0.0)
