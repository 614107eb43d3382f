"""Velocities that were not measured but follow from measured positions or attitudes, and those along the world's axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.signals.rotation import conjugate, continuous, multiply, rotate
from auvnn.logs.signals.segments import GAP_STEPS

Array = NDArray[np.float64]


def of_positions(t: Array, x: Array) -> tuple[Array, Array]:
    """Return the middles of the steps, s, (M,), and the mean velocity over each, (M, k).

    (x[k+1] - x[k]) / (t[k+1] - t[k]) is the velocity in the middle of the step to second order, without a lag.

    Args:
        t: increasing, s, (N,).
        x: (N, k).
    """
    good = np.isfinite(x).all(axis=1)
    t, x = t[good], x[good]
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    keep = (steps > 0.0) & (steps <= GAP_STEPS * usual)
    return 0.5 * (t[1:] + t[:-1])[keep], (np.diff(x, axis=0)[keep] / steps[keep][:, None])


def of_attitudes(t: Array, q: Array) -> tuple[Array, Array]:
    """Return the middles of the steps, s, (M,), and the mean body rates over each, rad/s, (M, 3).

    The rotation from one attitude to the next, q_k* q_{k+1}, has the rotation vector omega dt where the axis stands
    still; its error over a step is of third order in the turn.

    Args:
        t: increasing, s, (N,).
        q: body to world, (N, 4).
    """
    good = np.isfinite(q).all(axis=1)
    t, q = t[good], continuous(q[good])
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    keep = (steps > 0.0) & (steps <= GAP_STEPS * usual)
    turn = multiply(conjugate(q[:-1]), q[1:])[keep]
    sine = np.linalg.norm(turn[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, turn[:, 0])
    scale = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)
    return 0.5 * (t[1:] + t[:-1])[keep], turn[:, 1:] * scale[:, None] / steps[keep][:, None]


def into_body(quaternion: Array, velocity: Array) -> Array:
    """Return velocities (N, 3) along the body's axes, given along north, east, down: R(q)^T v."""
    return rotate(conjugate(quaternion), velocity)


def turned(quaternion: Array, heading: float) -> Array:
    """Return attitudes (N, 4) whose heading is larger by `heading`, rad: a turn about the world's vertical."""
    if heading == 0.0:
        return quaternion
    turn = np.array([np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading)])
    return multiply(np.broadcast_to(turn, quaternion.shape), quaternion)
