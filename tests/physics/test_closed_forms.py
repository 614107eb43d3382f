"""Motions whose solution is known, integrated with the functions of the physics put together.

The integrator is a small Runge-Kutta method of the tests' own.
"""

import math

import numpy as np
import pytest
import torch

from auvnn.physics.attitude import quat_normalize, quat_rotate, quat_to_euler, quat_to_matrix
from auvnn.physics.coriolis import coriolis_force
from auvnn.physics.current import water_velocity
from auvnn.physics.drag import damping_force
from auvnn.physics.energy import kinetic_energy, potential_energy
from auvnn.physics.inertia import rigid_body_inertia
from auvnn.physics.kinematics import eta6_to_eta7, eta_derivative
from auvnn.physics.restoring import restoring_force

NO = torch.zeros(6, 6, dtype=torch.float64)


def tensor(values):
    return torch.tensor(values, dtype=torch.float64)


class Body:
    """A vehicle as plain tensors, with the equation of motion of Fossen in a uniform current."""

    def __init__(self, rigid, added=NO, linear=NO, quadratic=NO, w=0.0, b=0.0, cg=(0, 0, 0), cb=(0, 0, 0)):
        self.rigid, self.added, self.linear, self.quadratic = rigid, added, linear, quadratic
        self.static = (w, b, tensor(cg), tensor(cb))
        self.inverse = torch.linalg.inv(rigid + added)

    def acceleration(self, state, tau, v_ned):
        nu = state[7:13]
        rotation = quat_to_matrix(state[3:7])
        nu_c, nu_c_dot = water_velocity(rotation, nu[3:], v_ned)
        nu_r = nu - nu_c
        known = coriolis_force(self.rigid, nu) + coriolis_force(self.added, nu_r)
        known = known + damping_force(nu_r, self.linear, self.quadratic)
        known = known + restoring_force(rotation, *self.static)
        return self.inverse @ (tau - known + self.added @ nu_c_dot)

    def rate(self, tau=None, v_ned=None):
        tau = torch.zeros(6).double() if tau is None else tau
        v_ned = torch.zeros(3).double() if v_ned is None else v_ned

        def rate(t, state):
            return torch.cat((eta_derivative(state[:7], state[7:]), self.acceleration(state, tau, v_ned)))

        return rate


def start(eta=(0, 0, 0, 0, 0, 0), nu=(0, 0, 0, 0, 0, 0)):
    return torch.cat((eta6_to_eta7(tensor(eta)), tensor(nu)))


@pytest.fixture
def asymmetric(draw):
    """A body with its centre of gravity off the origin and a full added mass, damping and buoyancy."""
    rigid = rigid_body_inertia(30.0, 5.0 * draw.definite(3), 0.1 * draw(3))
    added, linear = 5.0 * draw.definite(6), 2.0 * draw.definite(6)
    quadratic = 5.0 * draw(6).abs().diag()
    return Body(rigid, added, linear, quadratic, 300.0, 305.0, [0.02, 0.01, 0.05], [0, 0, -0.02])


def test_terminal_velocity_under_quadratic_drag(rk4):
    """M u' = T - d u|u| from rest: u = V tanh(t/s), V = sqrt(T/d), s = M/sqrt(T d)."""
    thrust, drag, mass = 80.0, 120.0, 95.0 + 40.0
    quadratic = tensor([drag, 0, 0, 0, 0, 0]).diag()
    body = Body(
        tensor([95.0, 95, 95, 9, 9, 9]).diag(), tensor([40.0, 1, 1, 1, 1, 1]).diag(), quadratic=quadratic
    )
    for end in (0.8, 3.0, 20.0):
        state = rk4(body.rate(tensor([thrust, 0, 0, 0, 0, 0])), start(), end, 100)
        scale = mass / math.sqrt(thrust * drag)
        speed = math.sqrt(thrust / drag) * math.tanh(end / scale)
        way = mass / drag * math.log(math.cosh(end / scale))
        np.testing.assert_allclose([state[7].item(), state[0].item()], [speed, way], rtol=1e-5)


def test_free_roll_decay(rk4):
    """I phi'' + d phi' + B h phi = 0 for small angles: frequency and damping of the decay."""
    inertia, damping, buoyancy, height = 4.0 + 1.5, 3.0, 900.0, 0.06
    body = Body(
        tensor([90.0, 90, 90, 4.0, 9, 9]).diag(),
        tensor([40.0, 60, 60, 1.5, 3, 3]).diag(),
        tensor([10.0, 10, 10, damping, 9, 9]).diag(),
        w=buoyancy, b=buoyancy, cb=[0, 0, -height],
    )  # fmt: skip
    omega_0 = math.sqrt(buoyancy * height / inertia)
    decay = damping / (2 * inertia)
    omega = math.sqrt(omega_0**2 - decay**2)
    first = 1e-4
    for end in (0.5, 2.0, 2 * math.pi / omega):
        state = rk4(body.rate(), start((0, 0, 0, first, 0, 0)), end, 150)
        roll = quat_to_euler(state[3:7])[0].item()
        exact = math.cos(omega * end) + decay / omega * math.sin(omega * end)
        assert roll / first == pytest.approx(math.exp(-decay * end) * exact, abs=1e-6)


def test_hydrostatic_equilibrium(rk4):
    """A neutral vehicle comes to rest with W r_g - B r_b along the vertical: tan(theta) = -x/z."""
    weight, cg, cb = 500.0, [0.012, -0.008, 0.03], [0.0, 0.0, -0.02]
    body = Body(
        rigid_body_inertia(weight / 9.81, tensor([2.0, 3.0, 3.0]).diag(), tensor(cg)),
        linear=tensor([80.0, 80, 80, 12, 14, 14]).diag(),
        w=weight, b=weight, cg=cg, cb=cb,
    )  # fmt: skip
    state = rk4(body.rate(), start((0, 0, 0, 0.5, 0.3, 0.2)), 25.0, 400)
    x, y, z = (g - b for g, b in zip(cg, cb, strict=True))
    roll, pitch, _ = quat_to_euler(quat_normalize(state[3:7])).tolist()
    assert roll == pytest.approx(math.atan2(y, z), abs=1e-6)
    assert pitch == pytest.approx(-math.atan2(x, math.hypot(y, z)), abs=1e-6)
    assert state[7:].abs().max() < 1e-6


def test_steady_turn_needs_the_centripetal_force_and_closes(rk4):
    """With tau = C(nu) nu a level body runs a circle of radius u/r about the vertical."""
    mass, x_g, a11, a22, u, r = 90.0, 0.15, 20.0, 70.0, 0.8, 0.5
    rigid = rigid_body_inertia(mass, tensor([4.0, 9.0, 9.0]).diag(), tensor([x_g, 0, 0]))
    body = Body(rigid, tensor([a11, a22, 80, 2, 4, 5]).diag())
    tau = tensor([-mass * x_g * r * r, (mass + a11) * u * r, 0, 0, 0, mass * x_g * u * r])
    first = start(nu=(u, 0, 0, 0, 0, r))
    state = rk4(body.rate(tau), first, 0.5 * math.pi / r, 100)
    np.testing.assert_allclose(state[:3].numpy(), [u / r, u / r, 0.0], atol=1e-7)
    np.testing.assert_allclose(state[7:].numpy(), first[7:].numpy(), atol=1e-9)
    state = rk4(body.rate(tau), first, 2 * math.pi / r, 200)
    np.testing.assert_allclose(state[:3].numpy(), np.zeros(3), atol=1e-6)


def test_torque_free_rotation_keeps_energy_and_both_momenta(draw, rk4):
    """About an arbitrary origin: energy, R p1 and R p2 + x cross R p1 stay what they were."""
    rigid = rigid_body_inertia(3.0, tensor([1.0, 2.0, 4.0]).diag(), tensor([0.1, -0.2, 0.3]))
    body = Body(rigid)

    def kept(state):
        momentum = rigid @ state[7:]
        linear, angular = quat_rotate(state[3:7], momentum.reshape(2, 3)).numpy()
        energy = kinetic_energy(rigid, state[7:]).item()
        return np.r_[energy, linear, angular + np.cross(state[:3].numpy(), linear)]

    first = start((1, 2, 3, 0.3, 0.2, 0.1), (0.3, -0.2, 0.1, 0.05, 2.0, 0.1))
    last = rk4(body.rate(), first, 6.0, 600)
    assert (last[10:] - first[10:]).abs().max() > 0.5  # it tumbles (intermediate axis)
    np.testing.assert_allclose(kept(last), kept(first), atol=1e-7)


def test_energy_balance_of_a_damped_vehicle(asymmetric, rk4):
    """Kinetic and potential energy change by the work of tau less what damping takes."""
    body, tau = asymmetric, tensor([20.0, -10, 5, 1, 2, -3])
    total = body.rigid + body.added

    def rate(t, state):
        nu = state[7:13]
        taken = nu @ damping_force(nu, body.linear, body.quadratic)
        return torch.cat((body.rate(tau)(t, state[:13]), (nu @ tau).reshape(1), taken.reshape(1)))

    def energy(state):
        rotation = quat_to_matrix(state[3:7])
        return kinetic_energy(total, state[7:13]) + potential_energy(state[:3], rotation, *body.static)

    first = torch.cat((start((0, 0, 5, 0.4, -0.3, 1), (0.5, 0.2, -0.1, 0.3, -0.4, 0.6)), tensor([0.0, 0.0])))
    last = rk4(rate, first, 3.0, 400)
    work, taken = last[13:].tolist()
    assert taken > 1.0
    assert (energy(last) - energy(first)).item() == pytest.approx(work - taken, abs=1e-6)


def test_motion_in_a_current_is_motion_in_still_water_seen_from_a_drifting_boat(asymmetric, rk4):
    """Galileo: the same forces and start relative to the water give the same motion relative to it."""
    v_ned, tau = tensor([0.3, -0.2, 0.1]), tensor([20.0, -10, 5, 1, 2, -3])
    still = start((0, 0, 5, 0.4, -0.3, 1), (0.5, 0.2, -0.1, 0.3, -0.4, 0.6))

    def drifting(state, end):
        along = quat_to_matrix(state[3:7]).T @ v_ned
        return torch.cat((state[:3] + end * v_ned, state[3:7], state[7:10] + along, state[10:]))

    in_current = rk4(asymmetric.rate(tau, v_ned), drifting(still, 0.0), 3.0, 300)
    expected = drifting(rk4(asymmetric.rate(tau), still, 3.0, 300), 3.0)
    assert (in_current - still).abs().max() > 0.5
    torch.testing.assert_close(in_current, expected, atol=1e-8, rtol=0)
