"""Energy, for checks: what the conservative part of the equations must keep."""

from __future__ import annotations

from auvnn.physics.products import matvec
from auvnn.shapes import Matrix6, Number, Rotation, Scalar, Vector3, Velocity


def kinetic_energy(inertia: Matrix6, nu: Velocity) -> Scalar:
    """Return the kinetic energy T = 1/2 nu' M nu.

    Args:
        inertia: (..., 6, 6), kg, kg m, kg m2.
        nu: body velocity, m/s and rad/s (..., 6).

    Returns:
        (...), J. Fossen 2011, section 3.3 and, for the water, 6.3.
    """
    return 0.5 * (nu * matvec(inertia, nu)).sum(-1)


def potential_energy(
    position: Vector3, rotation: Rotation, weight: Number, buoyancy: Number, cg: Vector3, cb: Vector3
) -> Scalar:
    """Return the potential energy of weight and buoyancy, with down positive.

    V = -W (p + R r_g)_z + B (p + R r_b)_z

    Args:
        position: of the origin in world axes (NED), m (..., 3).
        rotation: body to world (..., 3, 3).
        weight: N, a number or (...).
        buoyancy: N, a number or (...).
        cg: centre of gravity in body axes, m (..., 3).
        cb: centre of buoyancy in body axes, m (..., 3).

    Returns:
        (...), J; its gradient is the restoring force. Fossen 2011, section 4.1.
    """
    down, depth = rotation[..., 2, :], position[..., 2]
    return buoyancy * (depth + (down * cb).sum(-1)) - weight * (depth + (down * cg).sum(-1))
