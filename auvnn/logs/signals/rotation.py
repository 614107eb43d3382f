"""Quaternions (w, x, y, z) and Euler angles of recorded attitudes, in numpy; NaN in, NaN out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def multiply(a: Array, b: Array) -> Array:
    """Return the quaternion product a b, (..., 4); the rotation b first, then a."""
    aw, av, bw, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = aw * bw - (av * bv).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, aw * bv + bw * av + np.cross(av, bv)], axis=-1)


def conjugate(q: Array) -> Array:
    """Return the conjugate, which for a unit quaternion is the inverse rotation, (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Array, v: Array) -> Array:
    """Return the vectors v (..., 3) turned by the unit quaternions q (..., 4): body to world."""
    twice = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice + np.cross(q[..., 1:], twice)


def from_euler(angles: Array) -> Array:
    """Return the quaternion of roll, pitch, yaw (ZYX), rad, (..., 3) to (..., 4)."""
    half = 0.5 * angles
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def to_euler(q: Array) -> Array:
    """Return roll, pitch, yaw (ZYX), rad, in (-pi, pi], [-pi/2, pi/2], (-pi, pi], of unit quaternions."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def continuous(q: Array) -> Array:
    """Return the same attitudes without sign flips from one present sample to the next, (N, 4)."""
    return q * signs(q)[:, None]


def signs(q: Array) -> Array:
    """Return the sign (N,) of each sample that makes attitudes (N, 4) continuous; 1 where one is missing."""
    found = np.ones(len(q))
    rows = np.flatnonzero(np.isfinite(q).all(axis=-1))
    if len(rows) > 1:
        there = q if len(rows) == len(q) else q[rows]
        dots = np.einsum("ij,ij->i", there[1:], there[:-1])
        found[rows[1:]] = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    return found


def body_rates(q: Array, q_dot: Array) -> Array:
    """Return the body rates (N, 3), rad/s, of attitudes q and their derivatives: 2 (q* q_dot) / |q|^2."""
    product = multiply(conjugate(q), q_dot)[..., 1:]
    return 2.0 * product / (q * q).sum(axis=-1, keepdims=True)
