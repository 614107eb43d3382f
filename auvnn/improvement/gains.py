"""By how much free running improves, and how sure that is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.metrics.rollouts import Rolled, Scale

Array = NDArray[np.float64]
BLOCKS = 20


def paired_gain(before: Rolled, after: Rolled, scale: Scale) -> tuple[float, float]:
    """Return by how much the total error falls, and its standard error by leaving out blocks of windows.

    Blocks of neighbouring windows hold the correlation within them (Kuensch 1989, Annals of Statistics 17(3)).

    Args:
        before: free runs of the first model.
        after: those of the second over the same windows.
        scale: of the velocities, by which errors become comparable.
    """
    value = before.total(scale) - after.total(scale)
    count = len(before.windows)
    block = np.arange(count) * min(BLOCKS, count) // max(count, 1)
    without = [before.total(scale, block != b) - after.total(scale, block != b) for b in np.unique(block)]
    n = len(without)
    if n < 2:
        return value, float("inf")
    return value, float(np.sqrt((n - 1) / n * np.sum((np.array(without) - np.mean(without)) ** 2)))
