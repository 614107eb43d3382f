"""The water's own motion, seen from the vehicle."""

from __future__ import annotations

from torch.nn.functional import pad

from auvnn.physics.products import cross, matvec
from auvnn.shapes import Rotation, Vector3, Velocity


def water_velocity(
    rotation: Rotation, omega: Vector3, v_ned: Vector3, a_ned: Vector3 | None = None
) -> tuple[Velocity, Velocity]:
    """Return velocity and acceleration of irrotational water as the turning vehicle sees them.

    nu_c = [R' v ; 0], nu_c_dot = [-omega x R' v + R' a ; 0]

    The relative velocity is nu_r = nu - nu_c. The acceleration term is there in a steady current too: the
    current's components in body axes change while the vehicle turns.

    Args:
        rotation: body to world (NED) (..., 3, 3).
        omega: angular rate of the vehicle in body axes, rad/s (..., 3).
        v_ned: velocity of the water in world axes, m/s (..., 3).
        a_ned: its rate of change in world axes as the vehicle meets it, m/s2 (..., 3); none if steady.

    Returns:
        nu_c and nu_c_dot, (..., 6), m/s and m/s2. Fossen 2011, section 8.3.
    """
    to_body = rotation.mT
    v = matvec(to_body, v_ned)
    rate = cross(v, omega)
    if a_ned is not None:
        rate = rate + matvec(to_body, a_ned)
    return pad(v, (0, 3)), pad(rate, (0, 3))
