"""Trapped water: against a heavier vehicle without the weight."""

from __future__ import annotations

import torch

from auvnn.models import GreyBox
from auvnn.testing import make_scene, plain_vehicle


def test_it_is_a_heavier_vehicle_that_stays_neutral():
    vehicle = plain_vehicle(center_of_gravity=[0.05, 0.0, 0.0], buoyancy=0.0001, gravity=1e-7)
    heavier = plain_vehicle(center_of_gravity=[0.05, 0.0, 0.0], buoyancy=0.0001, gravity=1e-7, mass=62.0)
    scene = make_scene(vehicle, "wrench", runs=10)
    command = 1e5 * scene.inputs.each()[0].command
    model = GreyBox(vehicle, actuation="wrench").with_effects({"trapped_water": {"mass": 12.0}})
    with torch.no_grad():
        found = model(scene.eta, scene.nu, command)
        expected = GreyBox(heavier, actuation="wrench")(scene.eta, scene.nu, command)
    torch.testing.assert_close(found, expected, rtol=1e-6, atol=1e-6)


def test_at_rest_nothing_tells_of_it(plain, vector, still):
    tilted = vector(0, 0, 5, 0.3, 0.2, 0)
    rate = plain({"trapped_water": {"mass": 12.0}})(tilted, still, still)
    assert rate.abs().max().item() < 1e-14
