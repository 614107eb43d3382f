"""Kinematics: from body velocity to the rate of the pose, and between the two forms of a pose."""

from __future__ import annotations

import torch

from auvnn.physics.attitude import euler_to_quat, quat_derivative, quat_rotate, quat_to_euler
from auvnn.shapes import Pose6, Pose7, Pose7Rate, Velocity


def eta_derivative(eta: Pose7, nu: Velocity) -> Pose7Rate:
    """Return the rate of the pose: p_dot = R(q) v, q_dot = 1/2 q (0, omega).

    Args:
        eta: position in m and unit quaternion (..., 7).
        nu: body velocity [u v w p q r] of the origin, m/s and rad/s (..., 6).

    Returns:
        (..., 7), m/s and 1/s. Fossen 2011, section 2.2.2.
    """
    q = eta[..., 3:]
    return torch.cat((quat_rotate(q, nu[..., :3]), quat_derivative(q, nu[..., 3:])), -1)


def eta6_to_eta7(eta: Pose6) -> Pose7:
    """Return position and quaternion (..., 7) of position in m and Euler angles in rad (..., 6)."""
    return torch.cat((eta[..., :3], euler_to_quat(eta[..., 3:])), -1)


def eta7_to_eta6(eta: Pose7) -> Pose6:
    """Return position and Euler angles (..., 6) of position in m and unit quaternion (..., 7)."""
    return torch.cat((eta[..., :3], quat_to_euler(eta[..., 3:])), -1)
