"""Inertia: rigid-body inertia about any origin, and its translation to another point."""

from __future__ import annotations

import torch

from auvnn.physics.attitude import skew
from auvnn.physics.products import LEVI_CIVITA, ProductTable
from auvnn.shapes import Flag, Matrix3, Matrix6, Number, Vector3

# Upper right block S(r)' of the 6x6 matrix: S(r)'_jk = sum_i eps_ijk r_i.
_SCREW = ProductTable(
    [
        [sum(s for i, j, k, s in LEVI_CIVITA if (i, j, k + 3) == (n, m // 6, m % 6)) for m in range(36)]
        for n in range(3)
    ]
)


def screw(r: Vector3) -> Matrix6:
    """Return the matrix that moves a velocity from the origin to the point r.

    H(r) = [I, S(r)' ; 0, I], so that nu_P = H(r) nu, and a wrench at P is H(r)' tau_P at the origin.

    Args:
        r: point in body axes, m (..., 3).

    Returns:
        (..., 6, 6), with H(a) H(b) = H(a + b). Fossen 2011, section 3.3.
    """
    blocks = torch.matmul(r, _SCREW.like(r)).unflatten(-1, (6, 6))
    return blocks + torch.eye(6, dtype=r.dtype, device=r.device)


def translate_inertia(inertia: Matrix6, r: Vector3) -> Matrix6:
    """Return about the origin an inertia (or linear damping) matrix given about the point r: H(r)' M H(r).

    Args:
        inertia: 6x6 matrix about the point r, axes parallel to the body's (..., 6, 6).
        r: the point in body axes, m (..., 3).

    Returns:
        (..., 6, 6), about the origin. Fossen 2011, section 3.3.
    """
    h = screw(r)
    return h.mT @ inertia @ h


def rigid_body_inertia(mass: Number, inertia_cg: Matrix3, cg: Vector3) -> Matrix6:
    """Return the rigid-body inertia matrix about the origin.

    M_RB = [m I, -m S(r_g) ; m S(r_g), I_g - m S(r_g)2]

    Args:
        mass: kg, a number or (...).
        inertia_cg: inertia tensor about the centre of gravity, kg m2 (..., 3, 3).
        cg: centre of gravity in body axes, m (..., 3).

    Returns:
        (..., 6, 6). Fossen 2011, section 3.3.
    """
    m = torch.as_tensor(mass, dtype=cg.dtype, device=cg.device)[..., None, None]
    s = skew(cg)
    coupling = m * s
    upper, down, lower = torch.broadcast_tensors(
        m * torch.eye(3, dtype=cg.dtype, device=cg.device), coupling, inertia_cg - coupling @ s
    )
    return torch.cat((torch.cat((upper, -down), -1), torch.cat((down, lower), -1)), -2)


def is_positive_definite(matrix: Matrix6 | Matrix3, tolerance: float = 1e-9) -> Flag:
    """Tell whether a matrix is symmetric and positive definite.

    Args:
        matrix: (..., n, n).
        tolerance: asymmetry allowed relative to the largest element.

    Returns:
        (...), boolean; false for a matrix with a value that is not finite.
    """
    finite = torch.isfinite(matrix).flatten(-2).all(-1)
    usable = torch.where(finite[..., None, None], matrix, 0.0)  # zeros, which are not positive definite
    size = usable.abs().amax((-2, -1))
    symmetric = (usable - usable.mT).abs().amax((-2, -1)) <= tolerance * size
    return symmetric & (torch.linalg.eigvalsh(usable)[..., 0] > 0.0)
