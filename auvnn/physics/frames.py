"""Other people's frames: forward-left-up bodies and east-north-up worlds, and back.

Every function is its own inverse (quaternions up to the sign, which does not change the attitude, where
noted), so one name serves both directions. Inside the library everything is FRD and NED.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from auvnn.physics.products import ProductTable
from auvnn.shapes import Matrix3, Matrix6, Quaternion, Vector3, Velocity

_FLIP = ProductTable([[1.0, -1.0, -1.0, 1.0, -1.0, -1.0]])
_SWAP = ProductTable([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_H = math.sqrt(0.5)
# As rows: where each component of (w, x, y, z) goes.
_BODY_FLIP = ProductTable(
    [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 1.0, 0.0]]
)
_WORLD_SWAP = ProductTable(
    [[0.0, _H, _H, 0.0], [-_H, 0.0, 0.0, -_H], [-_H, 0.0, 0.0, _H], [0.0, _H, -_H, 0.0]]
)
_BOTH = ProductTable([[_H, 0.0, 0.0, _H], [0.0, _H, _H, 0.0], [0.0, _H, -_H, 0.0], [_H, 0.0, 0.0, -_H]])


def flu_frd_vector(v: Vector3) -> Vector3:
    """Turn a body vector from forward-left-up into forward-right-down or back: (x, -y, -z), (..., 3)."""
    return v * _FLIP.like(v)[0, :3]


def flu_frd_velocity(nu: Velocity) -> Velocity:
    """Turn a velocity, acceleration or wrench from FLU into FRD or back: S x, S = diag(1,-1,-1,1,-1,-1)."""
    return nu * _FLIP.like(nu)[0]


def flu_frd_matrix(matrix: Matrix6 | Matrix3) -> Tensor:
    """Turn a 6x6 (inertia, damping) or 3x3 (inertia tensor) matrix from FLU into FRD or back: S M S.

    Of the 36 elements 16 change sign: Xv Xw Xq Xr, Yu Yp, Zu Zp, Kv Kw Kq Kr, Mu Mp, Nu Np. The same holds
    for matrices of |nu| nu terms.

    Args:
        matrix: (..., 6, 6) or (..., 3, 3).
    """
    s = _FLIP.like(matrix)[0, : matrix.shape[-1]]
    return matrix * s * s[:, None]


def flu_frd_quaternion(q: Quaternion) -> Quaternion:
    """Exchange the body frame FLU and FRD of a body-to-world quaternion: q (0, 1, 0, 0); twice gives -q.

    Args:
        q: (..., 4), (w, x, y, z), into any world frame.
    """
    return torch.matmul(q, _BODY_FLIP.like(q))


def enu_ned_vector(v: Vector3) -> Vector3:
    """Turn a world vector from east-north-up into north-east-down or back: (y, x, -z), (..., 3)."""
    return torch.matmul(v, _SWAP.like(v))


def enu_ned_quaternion(q: Quaternion) -> Quaternion:
    """Exchange the world frame ENU and NED of a body-to-world quaternion; twice gives -q.

    (0, 1, 1, 0)/sqrt(2) q, half a turn about the direction between east and north.

    Args:
        q: (..., 4), (w, x, y, z), from any body frame.
    """
    return torch.matmul(q, _WORLD_SWAP.like(q))


def enu_flu_quaternion(q: Quaternion) -> Quaternion:
    """Exchange both frames at once, ENU and FLU (as in ROS) with NED and FRD: exactly its own inverse.

    (w + z, x + y, x - y, w - z)/sqrt(2)

    Args:
        q: (..., 4), (w, x, y, z), body to world.
    """
    return torch.matmul(q, _BOTH.like(q))
