"""Propeller torque: against REMUS's measured roll, and the torque of each thruster about its own axis."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects.propeller_torque import PropellerTorque
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene, plain_vehicle
from auvnn.vehicle import load_vehicle


def test_remus_rolls_to_port_under_power():
    """Prestero: 3.86 N of thrust come with a moment of -0.543 N m."""
    vehicle = load_vehicle("remus100")
    bare = GreyBox(vehicle)
    model = bare.with_effects({"propeller_torque": {"coefficient": 0.543 / 3.86}})
    eta, nu = torch.zeros(6, dtype=torch.float64), torch.tensor([1.5, 0, 0, 0, 0, 0], dtype=torch.float64)
    full = torch.ones(1, dtype=torch.float64)
    with torch.no_grad():
        change = vehicle.inertia_matrix @ (model(eta, nu, full) - bare(eta, nu, full)).numpy()
    np.testing.assert_allclose(change, [0, 0, 0, -0.543, 0, 0], atol=1e-12)


def test_every_thruster_turns_about_its_own_axis_after_what_takes_from_its_thrust():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "thrusters")
    row = scene.inputs.each()[0]
    gain = {f"thruster_{i + 1}": 0.5 + 0.1 * i for i in range(6)}
    bare = GreyBox(vehicle).with_effects({"thruster_gain": gain})
    model = bare.with_effects({"propeller_torque": {"coefficient": 0.03}})
    with torch.no_grad():
        change = (model(scene.eta, scene.nu, row.command) - bare(scene.eta, scene.nu, row.command)).numpy()
        thrust = bare.actuators.static(row.command).numpy() * np.array(list(gain.values()))
    expected = np.zeros_like(change)
    for i, unit in enumerate(vehicle.thrusters):
        expected[:, 3:] += 0.03 * unit.handedness * thrust[:, i : i + 1] * unit.direction
    np.testing.assert_allclose(
        change, expected @ np.linalg.inv(vehicle.inertia_matrix).T, rtol=1e-9, atol=1e-12
    )


def test_a_wrench_has_one_propulsor_ahead(plain, level, still, vector):
    rate = plain({"propeller_torque": {"coefficient": 0.1}})(level, still, vector(7, 8, 9, 0, 0, 0))
    assert rate.tolist() == pytest.approx([0.1, 0.1, 0.1, 0.7 / 3, 0, 0])


def test_thrusters_without_a_sense_of_rotation_say_nothing():
    unit = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 1.0, "max_reverse": 1.0}
    vehicle = plain_vehicle(thrusters=[{**unit, "handedness": 0}])
    assert PropellerTorque.lacks(vehicle, "thrusters") and not PropellerTorque.lacks(vehicle, "wrench")
