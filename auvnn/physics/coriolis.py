"""Coriolis and centripetal forces of any symmetric inertia matrix: rigid body, added mass, or both."""

from __future__ import annotations

import torch

from auvnn.physics.products import LEVI_CIVITA, Bilinear, ProductTable, matvec
from auvnn.shapes import Matrix6, Velocity, Wrench

# omega x p1 -> force, omega x p2 -> moment, v x p1 -> moment
_FORCE = Bilinear(
    6,
    6,
    6,
    [
        *((i + 3, j, k, s) for i, j, k, s in LEVI_CIVITA),
        *((i + 3, j + 3, k + 3, s) for i, j, k, s in LEVI_CIVITA),
        *((i, j, k + 3, s) for i, j, k, s in LEVI_CIVITA),
    ],
)


def _blocks() -> ProductTable:
    """Lay out C = [0, -S(p1) ; -S(p1), -S(p2)] as a table from the six momenta to the 36 elements."""
    rows = [[0.0] * 36 for _ in range(6)]
    for i, j, k, s in LEVI_CIVITA:  # S(p)_kj = s p_i
        rows[i][6 * k + j + 3] -= s
        rows[i][6 * (k + 3) + j] -= s
        rows[i + 3][6 * (k + 3) + j + 3] -= s
    return ProductTable(rows)


_MATRIX = _blocks()


def coriolis_matrix(inertia: Matrix6, nu: Velocity) -> Matrix6:
    """Return the skew-symmetric Coriolis and centripetal matrix of an inertia matrix.

    C(nu) = [0, -S(p1) ; -S(p1), -S(p2)] with the momentum [p1; p2] = M nu

    Args:
        inertia: symmetric inertia matrix (..., 6, 6), kg, kg m, kg m2.
        nu: body velocity, m/s and rad/s (..., 6).

    Returns:
        (..., 6, 6), with C' = -C. Fossen 2011, theorem 3.2.
    """
    momentum = matvec(inertia, nu)
    return torch.matmul(momentum, _MATRIX.like(momentum)).unflatten(-1, (6, 6))


def coriolis_force(inertia: Matrix6, nu: Velocity) -> Wrench:
    """Return C(nu) nu without building the matrix.

    C(nu) nu = [omega x p1 ; v x p1 + omega x p2] with the momentum [p1; p2] = M nu (Kirchhoff's equations)

    Args:
        inertia: symmetric inertia matrix (..., 6, 6), kg, kg m, kg m2.
        nu: body velocity, m/s and rad/s (..., 6).

    Returns:
        (..., 6), N and N m, on the left-hand side of the equation of motion; nu' C nu = 0.
        Fossen 2011, theorem 3.2; for added mass section 6.3 (the Munk moment is part of it).
    """
    return _FORCE(nu, matvec(inertia, nu))
