"""Attitude against scipy's Rotation."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.physics.attitude import (
    euler_to_quat,
    matrix_to_quat,
    quat_conjugate,
    quat_derivative,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_rotate_inverse,
    quat_to_euler,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
    skew,
)

MANY = Rotation.random(200, random_state=1)


def scalar_first(rotation: Rotation) -> torch.Tensor:
    return torch.tensor(rotation.as_quat(canonical=True)[:, [3, 0, 1, 2]])


Q = scalar_first(MANY)


def same_attitude(a: torch.Tensor, b: torch.Tensor) -> None:
    sign = torch.sign((a * b).sum(-1, keepdim=True))
    torch.testing.assert_close(a * sign, b, atol=1e-14, rtol=0)


def test_skew_is_the_cross_product(draw):
    a, b = draw(10, 3), draw(10, 3)
    expected = np.cross(a.numpy(), b.numpy())
    np.testing.assert_allclose((skew(a) @ b[..., None])[..., 0].numpy(), expected, atol=1e-14)


def test_matrix_of_quaternion():
    np.testing.assert_allclose(quat_to_matrix(Q).numpy(), MANY.as_matrix(), atol=1e-14)


def test_quaternion_of_matrix():
    torch.testing.assert_close(matrix_to_quat(torch.tensor(MANY.as_matrix())), Q, atol=1e-14, rtol=0)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.0, 0.8], [1, 1, 1]])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi - 1e-7, np.pi])
def test_quaternion_of_matrix_at_the_awkward_angles(axis, angle):
    turn = Rotation.from_rotvec(angle * np.array([axis]) / np.linalg.norm(axis))
    same_attitude(matrix_to_quat(torch.tensor(turn.as_matrix())), scalar_first(turn))


def test_product_is_rotation_after_rotation():
    a, b = MANY[:100], MANY[100:]
    same_attitude(quat_multiply(scalar_first(a), scalar_first(b)), scalar_first(a * b))


def test_rotate_both_ways(draw):
    v = draw(200, 3)
    np.testing.assert_allclose(quat_rotate(Q, v).numpy(), MANY.apply(v.numpy()), atol=1e-14)
    np.testing.assert_allclose(
        quat_rotate_inverse(Q, v).numpy(), MANY.apply(v.numpy(), inverse=True), atol=1e-14
    )


def test_conjugate_and_normalize():
    same_attitude(quat_conjugate(Q), scalar_first(MANY.inv()))
    torch.testing.assert_close(quat_normalize(7.0 * Q), Q, atol=1e-15, rtol=0)


def test_euler_angles():
    angles = torch.tensor(MANY.as_euler("ZYX")[:, ::-1].copy())
    torch.testing.assert_close(quat_to_euler(Q), angles, atol=1e-12, rtol=0)
    same_attitude(euler_to_quat(angles), Q)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_euler_angles_of_a_vertical_vehicle_are_finite_and_give_the_same_attitude(pitch):
    q = euler_to_quat(torch.tensor([0.0, pitch, 0.4], dtype=torch.float64))
    again = quat_to_euler(q)
    assert torch.isfinite(again).all()
    assert abs(again[1] - pitch) < 1e-7


def test_rotation_vector():
    np.testing.assert_allclose(quat_to_rotvec(Q).numpy(), MANY.as_rotvec(), atol=1e-13)
    np.testing.assert_allclose(quat_to_rotvec(-Q).numpy(), MANY.as_rotvec(), atol=1e-13)
    same_attitude(rotvec_to_quat(torch.tensor(MANY.as_rotvec())), Q)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-4, 0.0099, 0.0101, 0.1])
def test_small_rotation_vectors_to_full_precision(size):
    vector = size * np.array([[0.48, -0.6, 0.64]])
    q = rotvec_to_quat(torch.tensor(vector))
    np.testing.assert_allclose(q.numpy()[0, 1:], 0.5 * np.sinc(size / (2 * np.pi)) * vector[0], rtol=4e-16)
    np.testing.assert_allclose(q.numpy()[0, 0], np.cos(size / 2), rtol=2e-16)
    np.testing.assert_allclose(quat_to_rotvec(q).numpy(), vector, rtol=2e-15, atol=0)


def test_derivative_is_the_slope_of_a_constant_rotation(draw):
    q, omega = draw.quaternion(), draw(3)

    def turned(t: torch.Tensor) -> torch.Tensor:
        return quat_multiply(q, rotvec_to_quat(t * omega))

    _, slope = torch.func.jvp(turned, (torch.zeros(1, dtype=torch.float64),), (torch.ones(1).double(),))
    torch.testing.assert_close(slope, quat_derivative(q, omega), atol=1e-15, rtol=0)


def test_derivatives_at_no_rotation():
    zero = torch.zeros(3, dtype=torch.float64)
    half = torch.cat((torch.zeros(1, 3), 0.5 * torch.eye(3))).double()
    for jacobian in (torch.func.jacfwd, torch.func.jacrev):
        torch.testing.assert_close(jacobian(rotvec_to_quat)(zero), half)
        for identity in (1.0, -1.0):
            q = torch.tensor([identity, 0.0, 0.0, 0.0], dtype=torch.float64)
            torch.testing.assert_close(jacobian(quat_to_rotvec)(q), 4.0 * identity * half.mT)
    curvature = torch.func.hessian(lambda v: rotvec_to_quat(v)[0])(zero)
    torch.testing.assert_close(curvature, -0.25 * torch.eye(3).double())
