"""Thruster gain: against other commands that give the same thrust."""

from __future__ import annotations

import math

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.vehicle import load_vehicle


@pytest.fixture
def rov():
    return GreyBox(load_vehicle("rov95"))


def at(model, command):
    zero = torch.zeros(6, dtype=torch.float64)
    return model(zero, zero, torch.tensor(command, dtype=torch.float64))


def test_a_quarter_of_the_thrust_is_half_the_command_of_a_quadratic_thruster(rov):
    weak = rov.with_effects({"thruster_gain": {"thruster_3": 0.25}})
    command = [0.8, -0.3, 0.6, 0.2, -0.5, 0.4, 0.1, -0.9]
    halved = [*command[:2], 0.5 * command[2], *command[3:]]
    torch.testing.assert_close(at(weak, command), at(rov, halved), rtol=1e-14, atol=1e-15)


def test_a_dead_thruster_and_one_that_is_wired_the_wrong_way(rov):
    dead = rov.with_effects({"thruster_gain": {"thruster_1": 0.0}})
    wrong = rov.with_effects({"thruster_gain": {"thruster_1": -1.0}})
    command = [0.8, -0.3, 0.6, 0.2, -0.5, 0.4, 0.1, -0.9]
    torch.testing.assert_close(at(dead, command), at(rov, [0.0, *command[1:]]), rtol=1e-14, atol=1e-15)
    torch.testing.assert_close(at(wrong, command), at(rov, [-0.8, *command[1:]]), rtol=1e-14, atol=1e-15)


def test_one_thruster_pushes_along_its_direction_at_its_lever(rov):
    unit = rov.vehicle.thrusters[1]
    model = rov.with_effects({"thruster_gain": {"thruster_2": 1.5}})
    command = [0.0, 0.4] + [0.0] * 6
    thrust = 1.5 * unit.max_forward * 0.4**2
    (x, y, _), (dx, dy, _) = unit.position, unit.direction
    gained = model.prepare().total @ (at(model, command) - at(model, [0.0] * 8))
    assert gained.tolist() == pytest.approx(
        [thrust * dx, thrust * dy, 0, 0, 0, thrust * (x * dy - y * dx)], abs=1e-11
    )
    assert math.isclose(dx, math.cos(math.radians(35)))


def test_a_commanded_wrench_is_scaled_axis_by_axis(plain, level, still, vector):
    model = plain({"thruster_gain": {"X": 0.5, "N": 2.0}})
    found = model(level, still, vector(10, 20, 30, 1, 2, 3))
    assert found.tolist() == pytest.approx([5 / 70, 20 / 80, 30 / 90, 1 / 3, 2 / 4.5, 6 / 6.5], 1e-14)
