"""Frames: exact round trips, the sixteen signs, and quaternions against matrices."""

import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.physics.attitude import quat_to_euler, quat_to_matrix
from auvnn.physics.coriolis import coriolis_force
from auvnn.physics.frames import (
    enu_flu_quaternion,
    enu_ned_quaternion,
    enu_ned_vector,
    flu_frd_matrix,
    flu_frd_quaternion,
    flu_frd_vector,
    flu_frd_velocity,
)

BODY = torch.tensor([1.0, -1.0, -1.0]).double().diag()
WORLD = torch.tensor([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]).double()
FLIPPED = ["Xv", "Xw", "Xq", "Xr", "Yu", "Yp", "Zu", "Zp", "Kv", "Kw", "Kq", "Kr", "Mu", "Mp", "Nu", "Np"]


def test_the_sixteen_cross_coefficients_that_change_sign():
    ones = torch.ones(6, 6, dtype=torch.float64)
    signs = flu_frd_matrix(ones)
    changed = [a + b for i, a in enumerate("XYZKMN") for j, b in enumerate("uvwpqr") if signs[i, j] < 0]
    assert changed == FLIPPED
    assert (signs.abs() == 1.0).all()


def test_a_full_damping_law_is_the_same_law_in_both_frames(draw):
    matrix, nu = draw(6, 6), draw(6)
    for law in (nu, nu.abs() * nu):
        converted = flu_frd_matrix(matrix) @ flu_frd_velocity(law)
        torch.testing.assert_close(converted, flu_frd_velocity(matrix @ law))


def test_coriolis_forces_are_the_same_in_both_frames(draw):
    m, nu = draw.definite(6), draw(6)
    converted = coriolis_force(flu_frd_matrix(m), flu_frd_velocity(nu))
    torch.testing.assert_close(converted, flu_frd_velocity(coriolis_force(m, nu)))


def test_inertia_tensor_keeps_its_energy(draw):
    inertia, omega = draw.definite(3), draw(3)
    turned = flu_frd_vector(omega)
    torch.testing.assert_close(turned @ flu_frd_matrix(inertia) @ turned, omega @ inertia @ omega)


@pytest.mark.parametrize(
    ("convert", "shape"),
    [
        (flu_frd_vector, (4, 3)),
        (flu_frd_velocity, (4, 6)),
        (flu_frd_matrix, (4, 6, 6)),
        (flu_frd_matrix, (4, 3, 3)),
        (enu_ned_vector, (4, 3)),
    ],
)
def test_twice_is_nothing(convert, shape, draw):
    x = draw(*shape)
    assert torch.equal(convert(convert(x)), x)
    assert not torch.equal(convert(x), x)


def test_vectors_against_matrices(draw):
    v = draw(10, 3)
    torch.testing.assert_close(flu_frd_vector(v), v @ BODY.T)
    torch.testing.assert_close(enu_ned_vector(v), v @ WORLD.T)


@pytest.mark.parametrize(
    ("convert", "world", "body", "sign"),
    [
        (flu_frd_quaternion, torch.eye(3).double(), BODY, -1.0),
        (enu_ned_quaternion, WORLD, torch.eye(3).double(), -1.0),
        (enu_flu_quaternion, WORLD, BODY, 1.0),
    ],
)
def test_quaternions_against_matrices(convert, world, body, sign):
    turn = Rotation.random(50, random_state=3)
    q = torch.tensor(turn.as_quat()[:, [3, 0, 1, 2]])
    torch.testing.assert_close(quat_to_matrix(convert(q)), world @ torch.tensor(turn.as_matrix()) @ body)
    torch.testing.assert_close(convert(convert(q)), sign * q)


def test_level_vehicle_that_looks_east():
    """The identity in ENU and FLU looks east and is level: yaw 90 degrees in NED."""
    euler = quat_to_euler(enu_flu_quaternion(torch.tensor([1.0, 0.0, 0.0, 0.0]).double()))
    torch.testing.assert_close(euler, torch.tensor([0.0, 0.0, torch.pi / 2]).double())
