"""Inflow loss: against a propeller's thrust at an advance speed, with the thruster's own motion by kinematics."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene, plain_vehicle


def test_it_vanishes_at_the_bollard_and_when_coasting(level, still, vector):
    unit = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}
    bare = GreyBox(plain_vehicle(thrusters=[unit]))
    model = bare.with_effects({"thrust_inflow_loss": {"coefficient": 12.0}})
    half, off = vector(0.5), vector(0.0)
    assert torch.equal(model(level, still, half), bare(level, still, half))
    moving = vector(0.8, 0, 0, 0, 0, 0)
    assert torch.equal(model(level, moving, off), bare(level, moving, off))
    # At half command and 0.8 m/s: 40 * 0.25 - 12 * 0.5 * 0.8 N; astern the same speed adds to the thrust.
    assert model(level, moving, half)[0].item() == pytest.approx((10.0 - 4.8) / 70)
    assert model(level, -moving, half)[0].item() == pytest.approx((10.0 + 4.8) / 70)
    # Running astern while moving ahead: revolutions backwards, water from ahead, more thrust astern.
    assert model(level, moving, -half)[0].item() == pytest.approx((-7.5 - 4.8) / 70)


def test_each_thruster_sees_the_water_where_it_is():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "thrusters")
    row, k = scene.inputs.each()[0], 7.0
    bare = GreyBox(vehicle)
    model = bare.with_effects({"thrust_inflow_loss": {"coefficient": k}})
    with torch.no_grad():
        change = (model(scene.eta, scene.nu, row.command) - bare(scene.eta, scene.nu, row.command)).numpy()
    nu, command = scene.nu.numpy(), row.command.numpy()
    expected = np.zeros_like(nu)
    for i, unit in enumerate(vehicle.thrusters):
        local = nu[:, :3] + np.cross(nu[:, 3:], unit.position)
        force = -k * np.abs(command[:, i]) * (local @ unit.direction)
        vector = force[:, None] * unit.direction
        expected += np.concatenate(
            [vector, np.cross(np.broadcast_to(unit.position, vector.shape), vector)], 1
        )
    np.testing.assert_allclose(
        change, expected @ np.linalg.inv(vehicle.inertia_matrix).T, rtol=1e-9, atol=1e-13
    )
