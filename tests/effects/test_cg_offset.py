"""Shift of the centre of gravity: against the lever of the weight, and a vehicle whose file states it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import euler_to_quat, quat_to_matrix
from auvnn.testing import example_vehicle, make_scene

WEIGHT = 490.5


def static_wrench(model, roll=0.0, pitch=0.0):
    """Return the wrench on the resting vehicle, without commands."""
    zero = torch.zeros(6, dtype=torch.float64)
    rotation = quat_to_matrix(euler_to_quat(torch.tensor([roll, pitch, 0.3], dtype=torch.float64)))
    terms = model.wrenches(zero[:3], rotation, zero, zero, Inputs(zero), zero[0])
    return sum(terms.values())


def test_weight_forward_pitches_the_nose_down_by_weight_times_arm(plain, level, still):
    model = plain({"cg_offset": {"x": 0.03}})
    assert static_wrench(model).tolist() == pytest.approx([0, 0, 0, 0, -WEIGHT * 0.03, 0], abs=1e-12)
    assert model(level, still, still)[4] < 0


def test_weight_to_starboard_rolls_to_starboard_by_weight_times_arm(plain, level, still):
    model = plain({"cg_offset": {"y": 0.02}})
    assert static_wrench(model).tolist() == pytest.approx([0, 0, 0, WEIGHT * 0.02, 0, 0], abs=1e-12)
    assert model(level, still, still)[3] > 0


def test_weight_below_rights_the_vehicle(plain):
    model = plain({"cg_offset": {"z": 0.04}})
    assert static_wrench(model, roll=0.3)[3].item() == pytest.approx(-WEIGHT * 0.04 * math.sin(0.3), 1e-12)
    assert static_wrench(model, pitch=-0.2)[4].item() == pytest.approx(WEIGHT * 0.04 * math.sin(0.2), 1e-12)


def test_a_push_at_the_origin_turns_a_vehicle_whose_mass_is_elsewhere(plain, level, still):
    """In yaw: forward force X with the mass to starboard turns to port; two equations, solved by hand."""
    y, m, x_added, i_z = 0.05, 50.0, 20.0, 6.5
    model = plain({"cg_offset": {"y": y}})
    push = still.clone()
    push[0] = 10.0
    # (m + A11) du - m y dr = X and -m y du + (I_z + m y2 + A66) dr = 0
    a, b, d = m + x_added, -m * y, i_z + m * y * y
    expected = -b * 10 / (a * d - b * b)
    assert model(level, still, push)[5].item() == pytest.approx(expected, 1e-12)
    assert expected > 0


def test_it_equals_a_vehicle_whose_file_says_so():
    vehicle, shift = example_vehicle(), np.array([0.03, -0.02, 0.015])
    moved = replace(vehicle, center_of_gravity=vehicle.center_of_gravity + shift)
    scene = make_scene(vehicle, "wrench")
    command = scene.inputs.each()[0].command
    model = GreyBox(vehicle, actuation="wrench").with_effects(
        {"cg_offset": dict(zip("xyz", shift, strict=True))}
    )
    expected = GreyBox(moved, actuation="wrench")(scene.eta, scene.nu, command)
    torch.testing.assert_close(model(scene.eta, scene.nu, command), expected, rtol=1e-13, atol=1e-14)
