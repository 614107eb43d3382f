"""Which windows of a run follow one another, and where one begins with the sample with which another ends."""

from __future__ import annotations

import itertools

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.metrics.free_run import away
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Windows of a chain.
CHAIN = 10
# Times that are nearer to one another are one moment, s.
SAME_MOMENT = 1e-6


def followed(windows: Windows, reach: float, longest: int = CHAIN) -> tuple[NDArray[np.int64], Array]:
    """Return the window that each one follows in its run, -1 where none does, and the time between them, s, (B,) each.

    A chain begins anew after so many windows: what is known of a force ten windows ago says no more.

    Args:
        windows: B windows.
        reach: time from a window's start to the end of its last cell, s.
        longest: windows of a chain, at most.
    """
    times = windows.times[:, windows.warmup :].numpy()
    begin, end = times[:, 0], times[:, -1]
    before, gap = np.full(len(begin), -1), np.zeros(len(begin))
    linked = 0
    order = np.lexsort((begin, windows.run))
    for one, other in itertools.pairwise(order):
        whole = end[one] - begin[one] > 0.9 * reach
        same = windows.run[one] == windows.run[other] and begin[other] >= end[one] - 1e-9
        linked = linked + 1 if same and whole and linked + 1 < longest else 0
        if linked:
            before[other] = one
            gap[other] = max(begin[other] - begin[one] - reach, 0.0)
    return before, gap


def offsets(windows: Windows, around: Tensor, before: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
    """Return what leads from each first state to the last one of the window before, and whether both are one moment.

    Args:
        windows: B windows.
        around: trajectories (B, L, 13).
        before: the window that each one follows, -1 where none does, (B,).

    Returns:
        offsets (B, 12); (B,) whether the window begins with the sample with which the one that it follows ends.
    """
    other = torch.as_tensor(np.maximum(before, 0))
    times = windows.times[:, windows.warmup :]
    same = (times[:, 0] - times[other, -1]).abs() < SAME_MOMENT
    return away(around[:, 0], around[other, -1]), same & torch.as_tensor(before >= 0)
