"""The rate of the pose against Fossen's Euler-angle form and against a finite turn by scipy."""

import math

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from auvnn.physics.kinematics import eta6_to_eta7, eta7_to_eta6, eta_derivative

POSE = [1.0, -2.0, 3.0, 0.4, -0.6, 2.0]


def test_against_euler_angle_rates(draw):
    """Fossen 2011, section 2.2.1: p_dot = R v, Theta_dot = T(Theta) omega."""
    nu, eta = draw(6), torch.tensor(POSE, dtype=torch.float64)
    rate = eta_derivative(eta6_to_eta7(eta), nu)
    _, angle_rate = torch.func.jvp(eta7_to_eta6, (eta6_to_eta7(eta),), (rate,))
    phi, theta, psi = POSE[3:]
    p, q, r = nu[3:].tolist()
    expected = [
        p + math.sin(phi) * math.tan(theta) * q + math.cos(phi) * math.tan(theta) * r,
        math.cos(phi) * q - math.sin(phi) * r,
        (math.sin(phi) * q + math.cos(phi) * r) / math.cos(theta),
    ]
    np.testing.assert_allclose(angle_rate[3:].numpy(), expected, atol=1e-13)
    turn = Rotation.from_euler("ZYX", [psi, theta, phi])
    np.testing.assert_allclose(rate[:3].numpy(), turn.apply(nu[:3].numpy()), atol=1e-13)


def test_constant_turn_for_a_while(draw, rk4):
    nu = draw(6)
    start = eta6_to_eta7(torch.tensor(POSE, dtype=torch.float64))
    end = rk4(lambda t, eta: eta_derivative(eta, nu), start, 2.0, 200)
    first = Rotation.from_quat(start[[4, 5, 6, 3]].numpy())
    expected = (first * Rotation.from_rotvec(2.0 * nu[3:].numpy())).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(end[[4, 5, 6, 3]].numpy()).as_matrix(), expected, atol=1e-8)
    assert abs(end[3:].norm() - 1.0) < 1e-8


def test_pose_round_trip(draw):
    eta = 0.5 * draw(20, 6)
    torch.testing.assert_close(eta7_to_eta6(eta6_to_eta7(eta)), eta, atol=1e-13, rtol=0)
