"""Vectors and attitudes in numpy; attitudes by scipy's rotations, so that their signs are somebody else's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Array, b: Array) -> Array:
    """Return a x b, (..., 3); many times faster than numpy's own on a few vectors."""
    return a.take(_NEXT, -1) * b.take(_LAST, -1) - a.take(_LAST, -1) * b.take(_NEXT, -1)


def times(matrix: Array, vector: Array) -> Array:
    """Return the product of matrices (..., m, n) with vectors (..., n)."""
    return np.matmul(matrix, vector[..., None])[..., 0]


def dot(a: Array, b: Array) -> Array:
    """Return the products of vectors, (..., 1), so that they scale vectors."""
    return (a * b).sum(-1, keepdims=True)


def cross_matrix(a: Array) -> Array:
    """Return the matrices of the maps b -> a x b, (..., 3, 3): columns a x e_j."""
    return np.stack([cross(a, np.broadcast_to(e, a.shape)) for e in np.eye(3)], axis=-1)


def matrix_of(quaternion: Array) -> Array:
    """Return rotations body to world (R, 3, 3) of quaternions (w, x, y, z), (R, 4)."""
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def quaternion_of(matrix: Array, near: Array) -> Array:
    """Return quaternions (w, x, y, z) of rotations (R, 3, 3), of the sign that is nearer to `near` (R, 4)."""
    found = Rotation.from_matrix(matrix).as_quat(scalar_first=True)
    return np.where((found * near).sum(-1, keepdims=True) < 0.0, -found, found)


def mounted(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation from a sensor's axes to the body's, by yaw, pitch and roll in turn, (3, 3).

    Args:
        roll: rad.
        pitch: rad.
        yaw: rad.
    """
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def orthonormal(matrix: Array) -> Array:
    """Return the rotations nearest to matrices (R, 3, 3) that have drifted by rounding."""
    left, _, right = np.linalg.svd(matrix)
    return left @ right
