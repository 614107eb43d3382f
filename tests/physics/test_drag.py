"""Damping: never feeds energy, and a displaced element equals its hand computation."""

import numpy as np
import torch

from auvnn.physics.drag import damping_force, element_force, element_transform
from auvnn.physics.inertia import translate_inertia


def axes_of(draw):
    basis, _ = torch.linalg.qr(draw(3, 3))
    return basis * torch.sign(torch.linalg.det(basis))


def test_against_a_loop_over_the_coefficients(draw):
    linear, quadratic, nu = draw(6, 6), draw(6, 6), draw(6)
    expected = np.zeros(6)
    for i in range(6):
        for j in range(6):
            n = float(nu[j])
            expected[i] += float(linear[i, j]) * n + float(quadratic[i, j]) * abs(n) * n
    np.testing.assert_allclose(damping_force(nu, linear, quadratic).numpy(), expected, atol=1e-13)


def test_linear_damping_with_a_definite_matrix_takes_energy(draw):
    linear, nu = draw.definite(6), 3.0 * draw(1000, 6)
    linear = linear + 0.5 * (draw(6, 6) - draw(6, 6).mT)  # the skew part does no work
    linear = 0.5 * (linear + linear.mT)
    assert ((nu * damping_force(nu, linear, torch.zeros(6, 6).double())).sum(-1) >= 0.0).all()


def test_diagonal_quadratic_damping_takes_energy(draw):
    quadratic, nu = draw(6).abs().diag(), 3.0 * draw(1000, 6)
    power = (nu * damping_force(nu, torch.zeros(6, 6).double(), quadratic)).sum(-1)
    assert (power > 0.0).all()


def test_element_takes_energy_wherever_it_sits(draw):
    nu = 3.0 * draw(1000, 6)
    force = element_force(nu, draw(3), axes_of(draw), draw(6).abs(), draw(6).abs())
    assert ((nu * force).sum(-1) >= 0.0).all()


def test_element_by_hand(draw):
    """A flat plate below and aft, turned about z, met by surge and pitch: written out in numpy."""
    nu, r, axes = draw(6).numpy(), draw(3).numpy(), axes_of(draw)
    linear, quadratic = draw(6).abs().numpy(), draw(6).abs().numpy()
    basis = axes.numpy()
    v = basis.T @ (nu[:3] + np.cross(nu[3:], r))
    omega = basis.T @ nu[3:]
    force = basis @ (linear[:3] * v + quadratic[:3] * np.abs(v) * v)
    moment = basis @ (linear[3:] * omega + quadratic[3:] * np.abs(omega) * omega)
    expected = np.r_[force, moment + np.cross(r, force)]
    got = element_force(
        torch.tensor(nu), torch.tensor(r), axes, torch.tensor(linear), torch.tensor(quadratic)
    )
    np.testing.assert_allclose(got.numpy(), expected, atol=1e-13)


def test_linear_element_at_the_published_offset():
    """D_L = diag(250, 200, 175, 20, 20, 15) at (0.08, 0.02, -0.10) m: the known cross terms."""
    position = torch.tensor([0.08, 0.02, -0.10], dtype=torch.float64)
    linear = torch.tensor([250.0, 200, 175, 20, 20, 15], dtype=torch.float64)
    eye, none = torch.eye(3).double(), torch.zeros(6).double()
    matrix = torch.func.jacfwd(lambda nu: element_force(nu, position, eye, linear, none))(none)
    torch.testing.assert_close(matrix, translate_inertia(linear.diag(), position))
    cross_terms = [matrix[0, 4], matrix[1, 3], matrix[1, 5], matrix[2, 4]]
    torch.testing.assert_close(torch.stack(cross_terms), torch.tensor([-25.0, 20, 16, -14]).double())


def test_transform_is_the_elements_own_velocity(draw):
    nu, r, axes = draw(6), draw(3), axes_of(draw)
    own = element_transform(r, axes) @ nu
    v = nu[:3].numpy() + np.cross(nu[3:].numpy(), r.numpy())
    np.testing.assert_allclose(own[:3].numpy(), axes.numpy().T @ v, atol=1e-14)
    np.testing.assert_allclose(own[3:].numpy(), axes.numpy().T @ nu[3:].numpy(), atol=1e-14)


def test_slope_at_rest_is_the_linear_damping(draw):
    linear, quadratic, rest = draw(6, 6), draw(6, 6), torch.zeros(6).double()
    for jacobian in (torch.func.jacfwd, torch.func.jacrev):
        torch.testing.assert_close(jacobian(lambda nu: damping_force(nu, linear, quadratic))(rest), linear)
