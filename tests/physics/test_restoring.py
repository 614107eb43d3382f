"""Restoring forces against the potential energy and against Fossen's component form."""

import math

import torch

from auvnn.physics.attitude import euler_to_quat, quat_multiply, quat_to_matrix, rotvec_to_quat
from auvnn.physics.energy import potential_energy
from auvnn.physics.restoring import restoring_force, restoring_gain

WEIGHT, BUOYANCY = 931.0, 945.0


def test_gradient_of_the_potential_energy(draw):
    """g = dV/d(small displacement and turn in body axes)."""
    q, position, cg, cb = draw.quaternion(), draw(3), draw(3), draw(3)

    def energy(step):
        moved = quat_multiply(q, rotvec_to_quat(step[3:]))
        at = position + quat_to_matrix(q) @ step[:3]
        return potential_energy(at, quat_to_matrix(moved), WEIGHT, BUOYANCY, cg, cb)

    slope = torch.func.grad(energy)(torch.zeros(6, dtype=torch.float64))
    force = restoring_force(quat_to_matrix(q), WEIGHT, BUOYANCY, cg, cb)
    assert force.abs().max() > 1.0
    torch.testing.assert_close(slope, force, atol=1e-10, rtol=0)


def test_components_as_in_the_book(draw):
    """Fossen 2011, section 4.1, written out."""
    phi, theta, psi = 0.3, -0.5, 1.1
    (xg, yg, zg), (xb, yb, zb) = draw(3).tolist(), draw(3).tolist()
    w, b = WEIGHT, BUOYANCY
    st, ct, sp, cp = math.sin(theta), math.cos(theta), math.sin(phi), math.cos(phi)
    expected = [
        (w - b) * st,
        -(w - b) * ct * sp,
        -(w - b) * ct * cp,
        -(yg * w - yb * b) * ct * cp + (zg * w - zb * b) * ct * sp,
        (zg * w - zb * b) * st + (xg * w - xb * b) * ct * cp,
        -(xg * w - xb * b) * ct * sp - (yg * w - yb * b) * st,
    ]
    rotation = quat_to_matrix(euler_to_quat(torch.tensor([phi, theta, psi], dtype=torch.float64)))
    cg, cb = (torch.tensor(r, dtype=torch.float64) for r in ([xg, yg, zg], [xb, yb, zb]))
    force = restoring_force(rotation, w, b, cg, cb)
    torch.testing.assert_close(force, torch.tensor(expected, dtype=torch.float64), atol=1e-10, rtol=0)


def test_gain_times_down_is_the_force(draw):
    rotation, cg, cb = quat_to_matrix(draw.quaternion(5)), draw(3), draw(3)
    gain = restoring_gain(WEIGHT, BUOYANCY, cg, cb)
    expected = restoring_force(rotation, WEIGHT, BUOYANCY, cg, cb)
    torch.testing.assert_close(rotation[:, 2] @ gain.mT, expected, atol=1e-10, rtol=0)


def test_heavy_vehicle_sinks_and_low_weight_rights():
    """Level and too heavy: -g points down; rolled with CG below CB: the moment rolls it back."""
    level = torch.eye(3, dtype=torch.float64)
    low, zero = torch.tensor([0.0, 0.0, 0.05]).double(), torch.zeros(3).double()
    assert -restoring_force(level, 110.0, 100.0, low, zero)[2] == 10.0
    rolled = quat_to_matrix(euler_to_quat(torch.tensor([0.2, 0.0, 0.0]).double()))
    assert -restoring_force(rolled, 100.0, 100.0, low, zero)[3] < 0.0
