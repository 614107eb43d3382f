"""Linear and quadratic damping of the whole vehicle, and of parts at offset centres."""

from __future__ import annotations

import torch

from auvnn.physics.inertia import screw
from auvnn.physics.products import matvec
from auvnn.shapes import Matrix3, Matrix6, Six, Vector3, Velocity, Wrench


def damping_force(nu_r: Velocity, linear: Matrix6, quadratic: Matrix6) -> Wrench:
    """Return the damping force: D(nu) nu = D_L nu + D_Q (|nu| nu), element by element in |nu| nu.

    Args:
        nu_r: velocity through the water, m/s and rad/s (..., 6).
        linear: D_L (..., 6, 6), positive for ordinary damping, N s/m and so on.
        quadratic: D_Q (..., 6, 6), N s2/m2 and so on.

    Returns:
        (..., 6), N and N m, on the left-hand side. Fossen 2011, section 6.4.
    """
    return matvec(linear, nu_r) + matvec(quadratic, nu_r.abs() * nu_r)


def element_transform(position: Vector3, axes: Matrix3) -> Matrix6:
    """Return the matrix T from the vehicle's velocity to a drag element's own velocity.

    T = diag(R', R') H(r); the element's force f goes back to the origin as T' f.

    Args:
        position: centre of the element in body axes, m (..., 3).
        axes: columns are the element's axes in body axes, orthonormal (..., 3, 3).

    Returns:
        (..., 6, 6).
    """
    h = screw(position)
    return torch.cat((axes.mT @ h[..., :3, :], axes.mT @ h[..., 3:, :]), -2)


def element_force(nu_r: Velocity, position: Vector3, axes: Matrix3, linear: Six, quadratic: Six) -> Wrench:
    """Return the damping force of one displaced element, about the origin.

    D nu = T' f(T nu) with f_i(x) = (l_i + q_i |x_i|) x_i and T = diag(R', R') H(r)

    Never feeds energy when the coefficients are not negative: nu' T' f(T nu) = sum x_i f_i(x) >= 0.

    Args:
        nu_r: velocity through the water, m/s and rad/s (..., 6).
        position: centre of the element in body axes, m (..., 3).
        axes: columns are the element's axes in body axes, orthonormal (..., 3, 3).
        linear: coefficient per own axis, N s/m and N m s (..., 6).
        quadratic: coefficient per own axis, N s2/m2 and N m s2 (..., 6).

    Returns:
        (..., 6), N and N m, on the left-hand side. Component build-up as in Fossen 2011, section 6.4.
    """
    transform = element_transform(position, axes)
    own = matvec(transform, nu_r)
    return matvec(transform.mT, (linear + quadratic * own.abs()) * own)
