"""Small damping problems with a known answer, made with plain numpy."""

from __future__ import annotations

import numpy as np

from auvnn.training.problem import DampingProblem

LINEAR = np.diag([250.0, 200, 175, 20, 20, 15]) + 5.0 * np.eye(6)[::-1]
QUADRATIC = np.diag([350.0, 350, 400, 100, 100, 75]) - 9.0 * np.eye(6, k=2)


def velocities(samples: int, seed: int = 0) -> np.ndarray:
    """Return smooth velocities (N, 6), as of a manoeuvre with a few sinusoids."""
    random, t = np.random.default_rng(seed), np.linspace(0, 1, samples)[:, None]
    waves = [np.sin(6.28 * (random.uniform(1, 9, 6) * t + random.uniform(0, 1, 6))) for _ in range(3)]
    return sum(waves) * np.array([0.3, 0.2, 0.2, 0.2, 0.2, 0.3])


def law(nu: np.ndarray) -> np.ndarray:
    """Return D_L nu + D_Q |nu| nu."""
    return nu @ LINEAR.T + (np.abs(nu) * nu) @ QUADRATIC.T


def problem(samples: int = 400, noise: float = 0.0, runs: int = 1, seed: int = 0, **kw) -> DampingProblem:
    """Return the law's samples, with noise relative to each axis' standard deviation."""
    nu = velocities(samples, seed)
    target = law(nu)
    random = np.random.default_rng(seed + 1)
    target = target + noise * target.std(0) * random.standard_normal(target.shape)
    return DampingProblem(nu, target, run=np.arange(samples) * runs // samples, **kw)
