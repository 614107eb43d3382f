"""Free runs of whole models against motion that can be written down."""

from __future__ import annotations

import math

import pytest
import torch

from auvnn.models import GreyBox, Inputs
from auvnn.physics.energy import kinetic_energy
from auvnn.testing import example_vehicle, plain_vehicle
from auvnn.vehicle import load_vehicle
from tests.unchecked import unchecked

DOUBLE = torch.float64


def model_of(**changes):
    return GreyBox(plain_vehicle(**changes), actuation="wrench")


def run(model, nu, wrench, times, eta=(0.0,) * 6, **options):
    times = torch.as_tensor(times, dtype=DOUBLE)
    commands = torch.tensor(wrench, dtype=DOUBLE).expand(len(times), 6)
    with torch.no_grad():
        return model.rollout(
            torch.tensor(eta, dtype=DOUBLE), torch.tensor(nu, dtype=DOUBLE), commands, times, **options
        )


def test_terminal_speed_solves_the_quadratic():
    d, q, force = 12.0, 30.0, 40.0
    model = model_of(linear_damping=[d, 20, 20, 5, 5, 5], quadratic_damping=[q, 40, 40, 5, 5, 5])
    result = run(model, [0.0] * 6, [force, 0, 0, 0, 0, 0], torch.linspace(0, 40, 81))
    assert result.nu[-1, 0].item() == pytest.approx(
        (-d + math.sqrt(d * d + 4 * q * force)) / (2 * q), rel=1e-8
    )


def test_a_steady_turn_is_a_circle():
    """The wrench that holds (u, v, r), worked out by hand, holds it, and the path closes after 2 pi / r."""
    d, (u, v, r) = [15.0, 25.0, 30.0, 5.0, 5.0, 8.0], (0.8, -0.2, 0.5)
    m11, m22 = 70.0, 80.0
    wrench = [d[0] * u - m22 * v * r, d[1] * v + m11 * u * r, 0, 0, 0, d[5] * r + (m22 - m11) * u * v]
    period = 2 * math.pi / r
    times = torch.linspace(0, period, 201, dtype=DOUBLE)
    result = run(model_of(linear_damping=d), [u, v, 0, 0, 0, r], wrench, times)
    torch.testing.assert_close(result.nu[-1], result.nu[0], rtol=0, atol=1e-12)
    assert result.eta[-1, :3].abs().max() < 1e-6
    # A body vector (u, v) that turns with r about a centre at distance |V| / r, to starboard of the path.
    centre = torch.tensor([-v / r, u / r], dtype=DOUBLE)
    distance = torch.linalg.norm(result.eta[:, :2] - centre, dim=-1)
    torch.testing.assert_close(distance, torch.full_like(distance, math.hypot(u, v) / r), rtol=1e-7, atol=0)


def test_small_rolling_has_the_period_of_a_pendulum():
    height = 0.06
    model = model_of(
        center_of_gravity=[0, 0, 0.5 * height], center_of_buoyancy=[0, 0, -0.5 * height], mass=50.0
    )
    # About the origin: Ix + m zg2 + A44; sway couples through m zg.
    zg = 0.5 * height
    inertia = 2.0 + 50 * zg**2 + 1.0 - (50 * zg) ** 2 / 80
    omega = math.sqrt(490.5 * height / inertia)
    times = torch.linspace(0, 2 * math.pi / omega, 101, dtype=DOUBLE)
    result = run(model, [0.0] * 6, [0.0] * 6, times, eta=(0, 0, 0, 1e-3, 0, 0), max_step=0.02)
    roll = 2 * result.eta[:, 4]
    torch.testing.assert_close(roll, 1e-3 * torch.cos(omega * times), rtol=0, atol=2e-8)


def test_without_forces_kinetic_energy_stays(bank):
    """RK4 loses it slowly, by a fifth-order amount: half the step, a thirty-second of the loss."""

    vehicle = unchecked(
        example_vehicle(),
        linear_damping=None,
        quadratic_damping=None,
        damping_elements=(),
        fins=(),
        gravity=1e-300,
        buoyancy=1e-300,
    )
    model = GreyBox(vehicle, actuation="wrench")
    losses = []
    for step in (0.1, 0.05, 0.025):
        result = run(
            model, [0.8, -0.4, 0.5, 0.9, -0.7, 0.6], [0.0] * 6, torch.linspace(0, 10, 11), max_step=step
        )
        energy = kinetic_energy(torch.tensor(vehicle.inertia_matrix), result.nu)
        losses.append(float((energy[-1] / energy[0] - 1).abs()))
    assert losses[-1] < 1e-6
    assert math.log2(losses[1] / losses[2]) > 4.5


def test_a_positive_rudder_turns_to_port_and_a_positive_elevator_dives():
    model = GreyBox(load_vehicle("remus100"))
    times = torch.linspace(0, 4, 41, dtype=DOUBLE)
    command = torch.full((41, 1), 1.0, dtype=DOUBLE)
    eta, nu = (
        torch.tensor([0, 0, 5.0, 0, 0, 0], dtype=DOUBLE),
        torch.tensor([1.5, 0, 0, 0, 0, 0], dtype=DOUBLE),
    )

    def steer(*angles):
        fins = torch.tensor(angles, dtype=DOUBLE).expand(41, 4)
        with torch.no_grad():
            result = model.rollout(eta, nu, Inputs(command, fins), times)
        return result.eta[-1], result.nu[-1]

    port, speed = steer(0.1, 0.1, 0.0, 0.0)
    assert speed[5] < -0.02 and port[1] < -0.05
    starboard, mirrored = steer(-0.1, -0.1, 0.0, 0.0)
    assert mirrored[5].item() == pytest.approx(-speed[5].item(), rel=1e-2) and starboard[1] > 0.05
    down, speed = steer(0.0, 0.0, 0.1, 0.1)
    up, _ = steer(0.0, 0.0, -0.1, -0.1)
    assert speed[4] < 0 and down[2] > up[2] + 0.1


def test_a_thruster_pushes_forwards_and_remus_reaches_a_plausible_speed():
    """Full thrust 3.86 N against 1.62 u2: 1.54 m/s."""
    vehicle = load_vehicle("remus100")
    model = GreyBox(vehicle, actuation="wrench")
    speed = math.sqrt(3.86 / 1.62)
    nu = torch.tensor([speed, 0, 0, 0, 0, 0], dtype=DOUBLE)
    push = torch.tensor([3.86, 0, 0, 0, 0, 0], dtype=DOUBLE)
    rate = model(torch.zeros(6, dtype=DOUBLE), nu, push, fins=torch.zeros(4, dtype=DOUBLE))
    assert abs((model.prepare().total @ rate)[0].item()) < 1e-12
    assert speed == pytest.approx(1.54, abs=0.01)
