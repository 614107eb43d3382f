"""The water's motion: acceleration term against differences, and the relative-velocity identity."""

import torch

from auvnn.physics.attitude import quat_multiply, quat_to_matrix, rotvec_to_quat
from auvnn.physics.coriolis import coriolis_force
from auvnn.physics.current import water_velocity
from auvnn.physics.inertia import rigid_body_inertia


def test_acceleration_is_the_slope_of_the_velocity_in_body_axes(draw):
    q, omega, v, a = draw.quaternion(), draw(3), draw(3), draw(3)

    def seen(t):
        rotation = quat_to_matrix(quat_multiply(q, rotvec_to_quat(t * omega)))
        return rotation.T @ (v + a * t)

    h = 1e-5
    slope = (seen(h) - seen(-h)) / (2 * h)
    nu_c, nu_c_dot = water_velocity(quat_to_matrix(q), omega, v, a)
    torch.testing.assert_close(nu_c[:3], quat_to_matrix(q).T @ v)
    torch.testing.assert_close(nu_c_dot[:3], slope, atol=1e-9, rtol=0)
    assert (nu_c[3:] == 0.0).all()
    assert (nu_c_dot[3:] == 0.0).all()


def test_steady_current_needs_no_acceleration_argument(draw):
    rotation, omega, v = quat_to_matrix(draw.quaternion()), draw(3), draw(3)
    without, explicit = (
        water_velocity(rotation, omega, v),
        water_velocity(rotation, omega, v, torch.zeros(3).double()),
    )
    torch.testing.assert_close(without[1], explicit[1])


def test_relative_velocity_identity_of_the_rigid_body(draw):
    """M_RB nu_dot + C_RB(nu) nu = M_RB nu_r_dot + C_RB(nu_r) nu_r in a steady irrotational current."""
    m = rigid_body_inertia(40.0, draw.definite(3, 20), draw(20, 3))
    nu, nu_dot, rotation, v = draw(20, 6), draw(20, 6), quat_to_matrix(draw.quaternion(20)), draw(20, 3)
    nu_c, nu_c_dot = water_velocity(rotation, nu[:, 3:], v)
    absolute = (m @ nu_dot[..., None])[..., 0] + coriolis_force(m, nu)
    relative = (m @ (nu_dot - nu_c_dot)[..., None])[..., 0] + coriolis_force(m, nu - nu_c)
    torch.testing.assert_close(absolute, relative, atol=1e-11, rtol=0)
