"""Sums over windows that no window was run for."""

from __future__ import annotations

import numpy as np

from auvnn.estimation.window_sums.statistics import Statistics


def bare_statistics(channel, count, rough, pairs, hessian=None) -> Statistics:
    b = len(channel)
    hessian = np.zeros((b, 1, 1)) if hessian is None else hessian
    return Statistics(
        hessian,
        np.zeros(hessian.shape[:2]),
        np.zeros(b),
        channel,
        count,
        rough,
        pairs,
        np.zeros(b, dtype=np.int64),
        np.arange(b),
    )
