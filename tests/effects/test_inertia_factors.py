"""Inertia factors: against Euler's equations of a body that only turns."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects.inertia_factors import InertiaFactors
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene
from tests.unchecked import unchecked

FACTORS = {"K": 2.0, "M": 0.5, "N": 1.5}


def with_factors(vehicle):
    return GreyBox(vehicle, [InertiaFactors.build(vehicle, "wrench", FACTORS)], actuation="wrench")


def test_a_moment_meets_the_scaled_moment_of_inertia(plain, level, still, vector):
    model = with_factors(plain().vehicle)
    found = model(level, still, vector(0, 0, 0, 1.0, 1.0, 1.0))
    assert found[3:].tolist() == pytest.approx([1 / (4 + 1), 1 / (1.5 + 1.5), 1 / (6 + 2.5)], 1e-14)


def test_turning_about_two_axes_turns_the_third(plain, level, still, vector):
    """Euler: (I_z + A66) dr = (I_x + A44 - I_y - A55) p q, with scaled I."""
    model = with_factors(plain().vehicle)
    found = model(level, vector(0, 0, 0, 0.4, 0.3, 0), still)
    assert found[5].item() == pytest.approx(((4 + 1) - (1.5 + 1.5)) * 0.4 * 0.3 / 8.5, 1e-13)


def test_products_of_inertia_scale_with_the_geometric_mean():
    vehicle = example_vehicle()
    root = np.sqrt(list(FACTORS.values()))
    scaled = unchecked(vehicle, inertia=vehicle.inertia * np.outer(root, root))
    scene = make_scene(vehicle, "wrench")
    command = scene.inputs.each()[0].command
    expected = GreyBox(scaled, actuation="wrench")(scene.eta, scene.nu, command)
    torch.testing.assert_close(
        with_factors(vehicle)(scene.eta, scene.nu, command), expected, rtol=1e-12, atol=1e-13
    )
