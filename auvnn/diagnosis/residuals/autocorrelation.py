"""What an explanation leaves: how much above white noise, and whether it is slower than white noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis

Array = NDArray[np.float64]
# Slow residuals count as something missing when they are significant and not negligible.
SLOW_Z, SLOW_SHARE = 4.0, 0.05


def is_autocorrelated(explanation: FittedHypothesis, floor: Array) -> bool:
    """Whether the errors left are slower than white noise: something is missing, with a name or without.

    Args:
        explanation: what was fitted.
        floor: (18,) no channel is trusted beyond.
    """
    sums = explanation.fitted.statistics
    channel, count, rough, pairs = (x.sum(0) for x in (sums.channel, sums.count, sums.rough, sums.pairs))
    return slower_than_white(channel, count, rough, pairs, len(sums.cost), floor)


def slower_than_white(
    channel: Array, count: Array, rough: Array, pairs: Array, windows: int, floor: Array
) -> bool:
    """Whether errors are slower than white noise, by their sums over all windows.

    Args:
        channel: (18,) squared errors.
        count: (18,) samples.
        rough: (18,) squared differences of successive errors.
        pairs: (18,) differences.
        windows: how many; each has spent twelve degrees of freedom on its initial state.
        floor: (18,) no channel is trusted beyond.
    """
    spent = 12 * windows * count / max(count.sum(), 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        slow_part = channel / np.maximum(count - spent, 1.0)
        fast = np.maximum(rough / (2 * pairs), floor**2)
        z = (slow_part / fast - 1.0) * np.sqrt(count)
        share = 1.0 - fast / slow_part
    return bool(np.any((count > 0) & (z > SLOW_Z) & (share > SLOW_SHARE)))


def excess_variance(explanation: FittedHypothesis, weights: FittedHypothesis) -> float:
    """Return the weighted squared error above what white noise alone would leave."""
    sums, sigma = explanation.fitted.statistics, weights.fitted.sigma
    noise = np.nan_to_num(weights.fitted.statistics.noise())
    usable = np.isfinite(sigma)
    count = sums.count.sum(0)
    spent = 12 * len(sums.cost) * count / max(count.sum(), 1.0)
    above = sums.channel.sum(0) - (count - spent) * noise**2
    return float(np.maximum(above[usable] / sigma[usable] ** 2, 0.0).sum())
