"""Coriolis forces: skew, powerless, and equal to four other derivations."""

import numpy as np
import pytest
import torch

from auvnn.physics.coriolis import coriolis_force, coriolis_matrix
from auvnn.physics.energy import kinetic_energy
from auvnn.physics.inertia import rigid_body_inertia


@pytest.fixture
def body(draw):
    return draw.definite(6, 50), draw(50, 6)


def test_matrix_is_skew_and_does_no_work(body):
    c = coriolis_matrix(*body)
    assert (c + c.mT).abs().max() == 0.0
    power = torch.einsum("ni,nij,nj->n", body[1], c, body[1])
    assert c.abs().max() > 1.0
    assert power.abs().max() < 1e-12
    assert (body[1] * coriolis_force(*body)).sum(-1).abs().max() < 1e-12


def test_force_is_matrix_times_velocity(body):
    m, nu = body
    expected = (coriolis_matrix(m, nu) @ nu[..., None])[..., 0]
    torch.testing.assert_close(coriolis_force(m, nu), expected, atol=1e-12, rtol=0)


def test_kirchhoff_with_the_momentum_from_the_kinetic_energy(draw):
    m, nu = draw.definite(6), draw(6)
    p = torch.func.grad(lambda n: kinetic_energy(m, n))(nu).numpy()
    v, omega = nu[:3].numpy(), nu[3:].numpy()
    expected = np.r_[np.cross(omega, p[:3]), np.cross(v, p[:3]) + np.cross(omega, p[3:])]
    np.testing.assert_allclose(coriolis_force(m, nu).numpy(), expected, atol=1e-12)


def test_lagrange_in_position_and_euler_angles(draw):
    """Q = d/dt dT/dq_dot - dT/dq must equal J^-T (M nu_dot + C nu), with nu = J^-1(q) q_dot."""
    m = draw.definite(6)
    q, q_dot, q_ddot = draw(6), draw(6), draw(6)

    def velocity(q, q_dot):
        phi, theta, psi = q[3], q[4], q[5]
        zero, one = torch.zeros_like(phi), torch.ones_like(phi)

        def turn(c, s, rows):
            table = {"c": c, "s": s, "n": -s, "0": zero, "1": one}
            return torch.stack([torch.stack([table[x] for x in row]) for row in rows])

        rz = turn(psi.cos(), psi.sin(), ["cn0", "sc0", "001"])
        ry = turn(theta.cos(), theta.sin(), ["c0s", "010", "n0c"])
        rx = turn(phi.cos(), phi.sin(), ["100", "0cn", "0sc"])
        p = q_dot[3] - q_dot[5] * theta.sin()
        q_rate = q_dot[4] * phi.cos() + q_dot[5] * theta.cos() * phi.sin()
        r = -q_dot[4] * phi.sin() + q_dot[5] * theta.cos() * phi.cos()
        return torch.cat(((rz @ ry @ rx).T @ q_dot[:3], torch.stack((p, q_rate, r))))

    def energy(q, q_dot):
        nu = velocity(q, q_dot)
        return 0.5 * nu @ m @ nu

    momentum = torch.func.grad(energy, argnums=1)
    _, momentum_rate = torch.func.jvp(momentum, (q, q_dot), (q_dot, q_ddot))
    generalised = momentum_rate - torch.func.grad(energy)(q, q_dot)
    nu, nu_dot = torch.func.jvp(velocity, (q, q_dot), (q_dot, q_ddot))
    to_nu = torch.func.jacfwd(velocity, argnums=1)(q, q_dot)
    expected = to_nu.T @ (m @ nu_dot + coriolis_force(m, nu))
    torch.testing.assert_close(generalised, expected, atol=1e-11, rtol=0)


def test_rigid_body_force_is_that_of_its_point_masses(draw):
    masses, places = draw(8).abs() + 0.1, draw(8, 3)
    mass = masses.sum()
    cg = masses @ places / mass
    arms = places - cg
    square = (arms * arms).sum(-1)[:, None, None] * torch.eye(3) - arms[:, :, None] * arms[:, None, :]
    inertia = (masses[:, None, None] * square).sum(0)
    nu = draw(6)
    v, omega = nu[:3].numpy(), nu[3:].numpy()
    # Acceleration of each point when nu_dot = 0: omega x (v + omega x r).
    forces = masses.numpy()[:, None] * np.cross(omega, v + np.cross(omega, places.numpy()))
    expected = np.r_[forces.sum(0), np.cross(places.numpy(), forces).sum(0)]
    force = coriolis_force(rigid_body_inertia(mass, inertia, cg), nu)
    np.testing.assert_allclose(force.numpy(), expected, atol=1e-12)


def test_munk_moment_destabilises():
    """-C_A nu gives M = (A33 - A11) u w and N = -(A22 - A11) u v."""
    added = torch.tensor([5.0, 40.0, 50.0, 1.0, 2.0, 3.0], dtype=torch.float64).diag()
    u, v, w = 1.5, 0.2, 0.3
    force = -coriolis_force(added, torch.tensor([u, v, w, 0, 0, 0], dtype=torch.float64))
    expected = torch.tensor([-(50 - 40) * v * w, (50 - 5) * u * w, -(40 - 5) * u * v], dtype=torch.float64)
    torch.testing.assert_close(force[3:], expected)
