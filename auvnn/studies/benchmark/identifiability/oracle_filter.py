"""The information of a log under a stochastic force: a Kalman filter through whole runs and its sensitivities.

The state is position, attitude, velocity, the force that wanders (Ornstein-Uhlenbeck) and, where the noise has a memory,
the sensors' errors (first order). With the innovations e_k, their covariances S_k and their slopes E_k with what is not
known, the information is the sum of E_k' S_k^-1 E_k. References: Kristensen, Madsen and Jorgensen (2004), Automatica 40,
for the likelihood; Ljung (1999), System Identification, chapter 7, for prediction errors under a controller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What is known of the first state: m, rad, m/s and rad/s.
FIRST = np.repeat([100.0, 3.0, 3.0, 3.0], 3)
# Variance that stands for a channel that was not measured, in variances of its noise; share of noise with a memory that
# is still white, so that no covariance is singular.
ABSENT, WHITE = 1e10, 1e-4


@dataclass(frozen=True)
class Noise:
    """What is random.

    Attributes:
        sigma: of the sensors, position, attitude and velocity, (12,).
        memory: correlation time of the sensors' noise, s; zero for white noise.
        further: variance added row by row, such as that of a clock that is off, (R, K + 1, 12).
        measured: (R, K + 1, 12).
        rms: of the force that wanders, N and N m, (6,).
        correlation: its times, s, (6,).
    """

    sigma: Array
    memory: float
    further: Array
    measured: NDArray[np.bool_]
    rms: Array
    correlation: Array


def information(transition: Array, push: Array, seen: Array, step: float, noise: Noise) -> Array:
    """Return the information (P, P) on what is not known, the initial states of all runs free.

    Args:
        transition: of (position, attitude, velocity, force) over each step, (R, K, 18, 18).
        push: slopes of the state after each step at a given state before it, (R, K, 12, P).
        seen: slopes of what the sensors report at a given state, (R, K + 1, 12, P).
        step: s.
        noise: what is random.
    """
    runs, steps = transition.shape[:2]
    size, coloured = 18, noise.memory > 0.0
    n = size + (12 if coloured else 0)
    phi = np.zeros((runs, n, n))
    spread = np.zeros(n)
    spread[12:18] = noise.rms**2 * (1.0 - np.exp(-2.0 * step / noise.correlation))
    start = np.concatenate([FIRST**2, noise.rms**2])
    h = np.zeros((12, n))
    h[:, :12] = np.eye(12)
    white = noise.sigma**2
    if coloured:
        a = np.exp(-step / noise.memory)
        phi[:, size:, size:] = a * np.eye(12)
        spread[size:] = (1.0 - a * a) * noise.sigma**2
        start, h[:, size:] = np.concatenate([start, noise.sigma**2]), np.eye(12)
        white = WHITE * white
    cover = np.broadcast_to(np.diag(start), (runs, n, n)).copy()
    unknown = seen.shape[-1]
    slope, total = np.zeros((runs, n, unknown)), np.zeros((unknown, unknown))
    for k in range(steps + 1):
        variance = white + noise.further[:, k] + np.where(noise.measured[:, k], 0.0, ABSENT * noise.sigma**2)
        innovation = cover @ h.T
        within = h @ innovation
        within[:, np.arange(12), np.arange(12)] += variance
        effect = h @ slope + seen[:, k]
        # Channels differ by orders of magnitude, and so do missing ones: scaled before anything is solved.
        unit = 1.0 / np.sqrt(np.einsum("rii->ri", within))
        scaled = within * unit[:, :, None] * unit[:, None, :]
        solved = np.linalg.solve(scaled, effect * unit[..., None])
        total += np.einsum("rcp,rcq->pq", effect * unit[..., None], solved)
        if k == steps:
            break
        gain = np.swapaxes(np.linalg.solve(scaled, np.swapaxes(innovation, 1, 2) * unit[..., None]), 1, 2)
        gain = gain * unit[:, None, :]
        keep = np.eye(n) - gain @ h
        # Joseph's form stays symmetric and positive.
        cover = keep @ cover @ np.swapaxes(keep, 1, 2) + (gain * variance[:, None, :]) @ np.swapaxes(
            gain, 1, 2
        )
        slope = slope - gain @ effect
        phi[:, :size, :size] = transition[:, k]
        cover = phi @ cover @ np.swapaxes(phi, 1, 2)
        cover[:, np.arange(n), np.arange(n)] += spread
        slope = phi @ slope
        slope[:, :12] += push[:, k]
    return 0.5 * (total + total.T)
