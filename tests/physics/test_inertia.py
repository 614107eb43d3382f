"""Inertia against sums over point masses and against Newton and Euler."""

import numpy as np
import torch

from auvnn.physics.inertia import is_positive_definite, rigid_body_inertia, screw, translate_inertia


def cloud(draw):
    """Return ten point masses in kg, their places in m, and what is known of them as one body."""
    masses, places = draw(10).abs().numpy() + 0.1, draw(10, 3).numpy()
    mass = masses.sum()
    cg = masses @ places / mass
    arms = places - cg
    inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True))
    return masses, places, mass, torch.tensor(inertia), torch.tensor(cg)


def test_rigid_body_is_the_sum_of_its_point_masses(draw):
    masses, places, mass, inertia, cg = cloud(draw)
    total = np.zeros((6, 6))
    for m, (x, y, z) in zip(masses, places, strict=True):
        to_point = np.array([[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]])
        total += m * to_point.T @ to_point  # kinetic energy of one point is m/2 |v + omega x r|2
    for given in (float(mass), torch.tensor(mass)):
        np.testing.assert_allclose(rigid_body_inertia(given, inertia, cg).numpy(), total, atol=1e-12)


def test_screw_is_the_velocity_of_a_point(draw):
    nu, r = draw(6), draw(3)
    expected = np.cross(nu[3:].numpy(), r.numpy()) + nu[:3].numpy()
    np.testing.assert_allclose((screw(r) @ nu).numpy(), np.r_[expected, nu[3:].numpy()], atol=1e-14)


def test_translated_inertia_obeys_newton_and_euler(draw):
    _, _, mass, inertia, cg = cloud(draw)
    about_cg = torch.block_diag(mass * torch.eye(3, dtype=torch.float64), inertia)
    nu_dot = draw(6)
    linear, angular, r = nu_dot[:3].numpy(), nu_dot[3:].numpy(), cg.numpy()
    force = mass * (linear + np.cross(angular, r))
    moment = inertia.numpy() @ angular + np.cross(r, force)
    wrench = translate_inertia(about_cg, cg) @ nu_dot
    np.testing.assert_allclose(wrench.numpy(), np.r_[force, moment], atol=1e-12)


def test_translation_there_and_back(draw):
    m, r = draw.definite(6), draw(3)
    torch.testing.assert_close(translate_inertia(translate_inertia(m, r), -r), m, atol=1e-12, rtol=0)


def test_positive_definite(draw):
    good = draw.definite(6)
    skewed, negative, broken = good.clone(), good.clone(), torch.eye(6, dtype=torch.float64)
    skewed[0, 5] += 1e-3
    negative[2, 2] = -1.0
    broken[0, 1] = broken[1, 0] = float("nan")
    answers = is_positive_definite(torch.stack((good, skewed, negative, broken, 0 * good)))
    assert answers.tolist() == [True, False, False, False, False]
