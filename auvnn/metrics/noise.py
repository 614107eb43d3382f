"""How noisy a run's channels are, and the same run with as much noise again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Run
from auvnn.logs.signals.noise import noise_std
from auvnn.logs.signals.rotation import conjugate, multiply

Array = NDArray[np.float64]


def white(run: Run, x: Array) -> Array:
    """Return the standard deviation of the white noise of each column, (k,); zero where it cannot be estimated."""
    return np.nan_to_num(np.asarray(noise_std(run.t, x), dtype=float))


def attitude_noise(run: Run) -> Array:
    """Return the standard deviation of the attitude's white noise as small turns about the body axes, rad, (3,).

    The turns from sample to sample add up to an angle about each axis that has the attitude's own noise,
    whatever the heading.
    """
    turns = 2 * multiply(conjugate(run.quaternion[:-1]), run.quaternion[1:])
    turns = turns[:, 1:] * np.where(turns[:, :1] < 0, -1.0, 1.0)
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(np.nan_to_num(turns), axis=0)])
    return white(run, np.where(np.isfinite(run.quaternion).all(1, keepdims=True), angle, np.nan))


def with_more_noise(run: Run, repeat: int = 0) -> Run:
    """Return the run with white noise added to attitude, velocity and acceleration, as large as its own.

    The noise is the same whenever it is asked for, and another one for another run or `repeat`.
    """
    random = np.random.default_rng([abs(run.number), repeat])
    half = 0.5 * attitude_noise(run) * random.normal(size=(run.samples, 3))
    small = np.concatenate([np.sqrt(np.clip(1 - (half**2).sum(1, keepdims=True), 0, 1)), half], axis=1)

    def louder(x: Array) -> Array:
        return x + white(run, x) * random.normal(size=x.shape)

    return replace(
        run,
        quaternion=multiply(run.quaternion, small),
        nu=louder(run.nu),
        nu_dot=None if run.nu_dot is None else louder(run.nu_dot),
    )
