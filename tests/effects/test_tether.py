"""Tether: against Hooke's law, a pendulum's period on the cable, and drag that takes power."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene

ANCHOR = {"north": 2.0, "east": -1.0, "down": 0.0}


def test_slack_is_slack_and_taut_pulls_to_the_anchor(plain, vector, still):
    model = plain({"tether": {"stiffness": 5.0, "slack": 4.0, **ANCHOR}})
    assert model(vector(2, -1, 3.9, 0, 0, 0), still, still).abs().max() == 0
    for place in ([6.0, 2.0, 5.0], [-3.0, -9.0, 2.0]):
        away = np.array(place) - [2, -1, 0]
        force = -5.0 * (np.linalg.norm(away) - 4) * away / np.linalg.norm(away)
        found = model(vector(*place, 0, 0, 0), still, still)[:3].tolist()
        assert found == pytest.approx(force / [70, 80, 90])
    # Heading east, a pull to the north comes from port.
    found = model(vector(-8, -1, 0, 0, 0, math.pi / 2), still, still)
    assert found[:3].tolist() == pytest.approx([0, -5.0 * 6 / 80, 0], abs=1e-12)


def test_a_mass_on_an_elastic_cable_swings_with_its_period(plain, vector, still):
    model = plain({"tether": {"stiffness": 7.0}})
    times = torch.linspace(0, 20, 201, dtype=torch.float64)
    run = model.rollout(vector(3, 0, 0, 0, 0, 0), still, torch.zeros(201, 6, dtype=torch.float64), times)
    expected = 3 * torch.cos(math.sqrt(7 / 70) * times)
    torch.testing.assert_close(run.eta[:, 0], expected, rtol=0, atol=1e-6)


def test_half_of_its_weight_hangs_on_the_vehicle(plain, vector, still):
    rate = plain({"tether": {"weight": 0.4}})(vector(3, 4, 12, 0, 0, 0), still, still)
    assert rate.tolist() == pytest.approx([0, 0, 0.5 * 0.4 * 13 / 90, 0, 0, 0])


def test_its_drag_is_against_the_motion_in_proportion_to_length_and_speed_squared():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "wrench", runs=10)
    row = scene.inputs.each()[0]
    bare = GreyBox(vehicle, actuation="wrench")
    model = bare.with_effects({"tether": {"drag": 1.3}})
    with torch.no_grad():
        change = (model(scene.eta, scene.nu, row.command) - bare(scene.eta, scene.nu, row.command)).numpy()
    force = change @ vehicle.inertia_matrix.T
    v, length = scene.nu[:, :3].numpy(), np.linalg.norm(scene.eta[:, :3].numpy(), axis=1)
    speed = np.linalg.norm(v, axis=1)
    expected = -1.3 * (length * speed)[:, None] * v
    np.testing.assert_allclose(force, np.pad(expected, ((0, 0), (0, 3))), rtol=1e-8, atol=1e-9)


def test_made_fast_at_the_stern_it_turns_the_vehicle_by_its_arm(plain, vector, still):
    at = {"stiffness": 5.0, "slack": 1.0, "x": -0.4, "z": 0.1}
    model = plain({"tether": at})
    # Heading north, made fast at (9.6, 0, 3.1) in the world, with the cable to the world's origin.
    end = np.array([10.0 - 0.4, 0.0, 3.0 + 0.1])
    length = np.linalg.norm(end)
    force = -5.0 * (length - 1.0) * end / length
    moment = np.cross([-0.4, 0.0, 0.1], force)
    found = model(vector(10, 0, 3, 0, 0, 0), still, still).tolist()
    inertia = np.array([70, 80, 90, *np.diag(model.vehicle.inertia_matrix)[3:]])
    assert found == pytest.approx(np.concatenate([force, moment]) / inertia, rel=1e-9, abs=1e-12)


def test_below_a_far_anchor_its_weight_is_buoyancy_that_falls_with_depth(plain, vector, still):
    """At a depth z, and r aside of an anchor at a height h, w (h + z + r^2 / 2 h) / 2: w / 2 for each metre of depth."""
    height, weight = 2000.0, 0.04
    vehicle, light = plain({}).vehicle, -0.5 * weight * height
    at = {n: float(v) for n, v in zip("xyz", vehicle.center_of_buoyancy, strict=True)}
    cable = plain({"tether": {"weight": weight, "down": -height, **at}})
    # What shrinks is the buoyancy that there is.
    shrinks = {"per_metre": 0.5 * weight / (float(vehicle.buoyancy) + light)}
    plainer = plain({"net_buoyancy": {"force": light}, "compressibility": shrinks})
    for place in ([0.0, 0.0, 10.0, 0.3, -0.2, 0.5], [8.0, -6.0, 400.0, -0.4, 0.1, 2.0]):
        found = cable(vector(*place), still, still)
        torch.testing.assert_close(found, plainer(vector(*place), still, still), rtol=1e-4, atol=1e-5)
    deep, high = (plainer(vector(0, 0, z, 0, 0, 0), still, still)[2] for z in (400.0, 0.0))
    assert deep > 1.1 * high
