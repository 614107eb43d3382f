"""Attitude: skew matrices, unit quaternions, rotation matrices, Euler angles and rotation vectors.

Quaternions are (w, x, y, z) and turn body vectors into world (NED) vectors. Fossen 2011, section 2.2.
"""

from __future__ import annotations

import torch

from auvnn.physics.products import LEVI_CIVITA, Bilinear, ProductTable, cross
from auvnn.shapes import EulerAngles, Matrix3, Quaternion, Rotation, Vector3

# S(a)_kj = sum_i eps_ijk a_i, flattened row by row.
_SKEW = ProductTable(
    [
        [sum(s for i, j, k, s in LEVI_CIVITA if (i, k, j) == (n, m // 3, m % 3)) for m in range(9)]
        for n in range(3)
    ]
)

# a*b = [a0 b0 - av.bv ; a0 bv + b0 av + av x bv]
_PRODUCT_TERMS = (
    (0, 0, 0, 1.0),
    *((n, n, 0, -1.0) for n in (1, 2, 3)),
    *((0, n, n, 1.0) for n in (1, 2, 3)),
    *((n, 0, n, 1.0) for n in (1, 2, 3)),
    *((i + 1, j + 1, k + 1, s) for i, j, k, s in LEVI_CIVITA),
)
_PRODUCT = Bilinear(4, 4, 4, _PRODUCT_TERMS)
_RATE = Bilinear(4, 3, 4, [(i, j - 1, k, 0.5 * s) for i, j, k, s in _PRODUCT_TERMS if j > 0])

# R = (w2 - qv.qv) I + 2 qv qv' + 2 w S(qv), flattened row by row.
_MATRIX = Bilinear(
    4,
    4,
    9,
    [
        *((0, 0, 4 * d, 1.0) for d in range(3)),
        *((n, n, 4 * d, -1.0) for n in (1, 2, 3) for d in range(3)),
        *((r + 1, c + 1, 3 * r + c, 2.0) for r in range(3) for c in range(3)),
        *((0, i + 1, 3 * k + j, 2.0 * s) for i, j, k, s in LEVI_CIVITA),
    ],
)

# 4 q q' = I + (linear in R): the inverse of the table above for unit q.
_OUTER_FROM_MATRIX = ProductTable(
    [
        [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1],  # R00
        [0, 0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0],  # R01
        [0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0],  # R02
        [0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0],  # R10
        [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1],  # R11
        [0, -1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0],  # R12
        [0, 0, -1, 0, 0, 0, 0, 1, -1, 0, 0, 0, 0, 1, 0, 0],  # R20
        [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0],  # R21
        [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1],  # R22
    ]
)

_SMALL = 1e-4
"""Squared angle, rad2, below which a power series replaces the closed form (its error is below 1e-16)."""


def skew(a: Vector3) -> Matrix3:
    """Return the cross-product matrix: S(a) b = a x b.

    Args:
        a: (..., 3).

    Returns:
        (..., 3, 3), with S' = -S. Fossen 2011, section 2.2.
    """
    return torch.matmul(a, _SKEW.like(a)).unflatten(-1, (3, 3))


def quat_normalize(q: Quaternion) -> Quaternion:
    """Return q / |q|, (..., 4); q must not be zero."""
    return q / torch.linalg.vector_norm(q, dim=-1, keepdim=True)


def quat_multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the Hamilton product a b: the rotation b followed by the rotation a.

    a b = [a0 b0 - av.bv ; a0 bv + b0 av + av x bv]

    Args:
        a: (..., 4), (w, x, y, z).
        b: (..., 4).
    """
    return _PRODUCT(a, b)


_CONJUGATE = ProductTable([[1.0, -1.0, -1.0, -1.0]])


def quat_conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse of a unit quaternion: (w, -x, -y, -z), (..., 4)."""
    return q * _CONJUGATE.like(q)[0]


def quat_to_matrix(q: Quaternion) -> Rotation:
    """Return the rotation matrix from body to world of a unit quaternion.

    R = (w2 - |qv|2) I + 2 qv qv' + 2 w S(qv)

    Args:
        q: unit quaternion (..., 4). A quaternion of length c gives c2 R.

    Returns:
        (..., 3, 3). Fossen 2011, section 2.2.2.
    """
    return _MATRIX(q, q).unflatten(-1, (3, 3))


def quat_rotate(q: Quaternion, v: Vector3) -> Vector3:
    """Turn a body vector into the world frame: R v = v + 2 w (qv x v) + 2 qv x (qv x v).

    Args:
        q: unit quaternion (..., 4).
        v: vector in body axes (..., 3), any unit.
    """
    axis = q[..., 1:]
    twice = 2.0 * cross(axis, v)
    return v + q[..., :1] * twice + cross(axis, twice)


def quat_rotate_inverse(q: Quaternion, v: Vector3) -> Vector3:
    """Turn a world vector into the body frame: R' v.

    Args:
        q: unit quaternion (..., 4), body to world.
        v: vector in world axes (..., 3), any unit.
    """
    axis = q[..., 1:]
    twice = 2.0 * cross(axis, v)
    return v - q[..., :1] * twice + cross(axis, twice)


def quat_derivative(q: Quaternion, omega: Vector3) -> Quaternion:
    """Return the rate of the quaternion: q_dot = 1/2 q (0, omega).

    Args:
        q: (..., 4).
        omega: angular rate [p q r] in body axes, rad/s (..., 3).

    Returns:
        (..., 4), 1/s. Fossen 2011, section 2.2.2, T_q(q) omega.
    """
    return _RATE(q, omega)


def euler_to_quat(euler: EulerAngles) -> Quaternion:
    """Return the unit quaternion of Euler angles: q = q_z(psi) q_y(theta) q_x(phi).

    Args:
        euler: roll, pitch, yaw in rad (..., 3).

    Returns:
        (..., 4). Fossen 2011, section 2.2.3.
    """
    c_phi, c_theta, c_psi = torch.cos(0.5 * euler).unbind(-1)
    s_phi, s_theta, s_psi = torch.sin(0.5 * euler).unbind(-1)
    cc, ss, cs, sc = c_theta * c_psi, s_theta * s_psi, c_theta * s_psi, s_theta * c_psi
    return torch.stack(
        (c_phi * cc + s_phi * ss, s_phi * cc - c_phi * ss, c_phi * sc + s_phi * cs, c_phi * cs - s_phi * sc),
        -1,
    )


def quat_to_euler(q: Quaternion) -> EulerAngles:
    """Return roll, pitch, yaw of a unit quaternion: phi, psi in (-pi, pi], theta in [-pi/2, pi/2].

    phi = atan2(R32, R33), theta = -asin(R31), psi = atan2(R21, R11)

    For the border of the library only: at theta = +-pi/2 roll and yaw are not unique and the gradient is
    not finite. Fossen 2011, section 2.2.3.

    Args:
        q: unit quaternion (..., 4).
    """
    r11, _, _, r21, _, _, r31, r32, r33 = _MATRIX(q, q).unbind(-1)
    return torch.stack((torch.atan2(r32, r33), -torch.asin(r31.clamp(-1.0, 1.0)), torch.atan2(r21, r11)), -1)


def rotvec_to_quat(v: Vector3) -> Quaternion:
    """Return the quaternion of a rotation vector: q = [cos(|v|/2) ; sin(|v|/2) v/|v|].

    Smooth at v = 0, where a power series takes over.

    Args:
        v: axis times angle, rad (..., 3).
    """
    square = (v * v).sum(-1, keepdim=True)
    small = square < _SMALL
    angle = torch.where(small, 1.0, square).sqrt()
    half = 0.5 * angle
    c = torch.where(small, 1.0 - square / 8.0 + square * square / 384.0, torch.cos(half))
    s = torch.where(small, 0.5 - square / 48.0 + square * square / 3840.0, torch.sin(half) / angle)
    return torch.cat((c, s * v), -1)


def quat_to_rotvec(q: Quaternion) -> Vector3:
    """Return the shortest rotation vector of a unit quaternion: v = 2 atan2(|qv|, w) qv/|qv| with w >= 0.

    Smooth at the identity, where a power series takes over.

    Args:
        q: unit quaternion (..., 4); q and -q give the same answer.

    Returns:
        Axis times angle, rad (..., 3), |v| <= pi.
    """
    q = torch.where(q[..., :1] < 0.0, -q, q)
    w, axis = q[..., :1], q[..., 1:]
    square = (axis * axis).sum(-1, keepdim=True)
    small = square < _SMALL * w * w
    w_small = torch.where(small, w, 1.0)
    t = torch.where(small, square, 0.0) / (w_small * w_small)
    series = 2.0 / w_small * (1.0 - t * (1.0 / 3.0 - t * (1.0 / 5.0 - t / 7.0)))
    length = torch.where(small, 1.0, square).sqrt()
    return torch.where(small, series, 2.0 * torch.atan2(length, w) / length) * axis


def matrix_to_quat(rotation: Rotation) -> Quaternion:
    """Return the unit quaternion of a rotation matrix, with w >= 0 and accurate for every angle.

    4 q q' is linear in R; the row with the largest diagonal element is normalised (Shepperd 1978).

    Args:
        rotation: (..., 3, 3), body to world.
    """
    flat = rotation.flatten(-2)
    outer = torch.matmul(flat, _OUTER_FROM_MATRIX.like(flat)).unflatten(-1, (4, 4))
    outer = outer + torch.eye(4, dtype=flat.dtype, device=flat.device)
    largest = outer.diagonal(dim1=-2, dim2=-1).argmax(-1, keepdim=True).unsqueeze(-1)
    row = torch.take_along_dim(outer, largest, -2).squeeze(-2)
    return quat_normalize(torch.where(row[..., :1] < 0.0, -row, row))
