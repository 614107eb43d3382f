"""How curved the likelihood of a law is in the sizes and the correlation times of its forces: Fisher's information.

With K the covariance of a window's forces and H what the window says of them, the data know of parameters a and b of the
law, in windows that do not hang together,

    I_ab = tr(M dK/da M dK/db) / 2,    M = (K + H^-1)^-1,

twice of which is what minus twice the log likelihood is expected to be curved by. With L L^T = K and S = L^T H L it is
tr(G D_a G D_b) / 2, G = (I + S)^-1 S, D_a = L^-1 dK/da L^-T: nothing has to be inverted that may be singular.

Reference: Searle, Casella and McCulloch (1992), Variance Components, chapter 8 (Fisher scoring).
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.metrics.force_law import covariance_of_means

Array = NDArray[np.float64]
# Step of the logarithm of a correlation time, by which covariances are differentiated.
STEP = 1e-4


def law_information(seen: Array, cell: float, rms: Array, time: Array) -> Array:
    """Return what minus twice the log likelihood is expected to be curved by in log rms and log time, (2 A, 2 A).

    Args:
        seen: (B, A K, A K) what windows say of the forces, one degree of freedom after the other; states integrated out.
        cell: length of the cells, s.
        rms: (A,) of the forces, N and N m.
        time: (A,) their correlation times, s.
    """
    count = len(rms)
    size = seen.shape[-1] // count
    root = np.zeros(seen.shape[1:])
    by_time = np.zeros(seen.shape[1:])
    for k in range(count):
        own = slice(k * size, (k + 1) * size)
        low, middle, high = (
            _covariance(size, cell, time[k] * np.exp(way * STEP)) for way in (-1.0, 0.0, 1.0)
        )
        unit = np.linalg.cholesky(middle)
        root[own, own] = rms[k] * unit
        half = np.linalg.solve(unit, (high - low) / (2.0 * STEP))
        by_time[own, own] = np.linalg.solve(unit, half.T)
    told = root.T @ seen @ root
    known = np.linalg.solve(told + np.eye(len(root)), told)
    by = [2.0 * known, known @ by_time]
    out = np.empty((2 * count, 2 * count))
    for i, one in enumerate(by):
        for j, other in enumerate(by):
            pairs = np.einsum("bpq,bqp->pq", one, other).reshape(count, size, count, size)
            out[i * count : (i + 1) * count, j * count : (j + 1) * count] = pairs.sum(axis=(1, 3)).T
    return out


def _covariance(count: int, cell: float, time: float) -> Array:
    return covariance_of_means(count, cell, torch.tensor(time, dtype=torch.float64)).numpy()
