"""Biofouling: against the decay of speed under linear drag that grows, in closed form."""

from __future__ import annotations

import math

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene


def test_speed_falls_as_the_integral_of_the_growing_drag(plain, level, vector, still):
    """m u' = -d (1 + k t) u gives u = u_0 exp(-d/m (t + k t^2/2))."""
    rate, drag = 0.05, 6.0
    model = plain({"biofouling": {"rate": rate}}, linear_damping=[drag, 6, 7, 1, 2, 3])
    times = torch.linspace(0, 20, 101, dtype=torch.float64)
    run = model.rollout(level, vector(0.8, 0, 0, 0, 0, 0), torch.zeros(101, 6, dtype=torch.float64), times)
    for t, nu in zip(times.tolist(), run.nu, strict=True):
        assert nu[0].item() == pytest.approx(0.8 * math.exp(-drag / 70 * (t + rate * t * t / 2)), rel=1e-7)


def test_all_that_resists_grows_alike_and_takes_power():
    vehicle = example_vehicle()
    scene, time = make_scene(vehicle, "wrench"), torch.tensor(30.0, dtype=torch.float64)
    row = scene.inputs.each()[0]
    model = GreyBox(vehicle, actuation="wrench").with_effects({"biofouling": {"rate": 0.02}})
    still = torch.eye(3, dtype=torch.float64).expand(4, 3, 3)
    with torch.no_grad():
        terms = model.wrenches(scene.eta[:, :3], still, scene.nu, row.command, row, time)
    drag = terms["linear damping"] + terms["quadratic damping"] + terms["damping elements"]
    torch.testing.assert_close(terms["biofouling"], 0.6 * drag, rtol=1e-13, atol=0)
    assert ((terms["biofouling"] * scene.nu).sum(-1) < 0).all()
