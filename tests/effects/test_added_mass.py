"""Added-mass factors: against the acceleration from rest, Munk's moment, and matrices written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene

FACTORS = {"X": 2.0, "Y": 0.5, "Z": 1.5, "K": 3.0, "M": 0.8, "N": 1.2}
MASS, ADDED = [50, 50, 50, 2, 3, 4], [20, 30, 40, 1, 1.5, 2.5]


@pytest.mark.parametrize("axis", range(6))
def test_from_rest_a_force_meets_mass_and_scaled_added_mass(plain, level, still, axis):
    model = plain({"added_mass": FACTORS})
    push = still.clone()
    push[axis] = 10.0
    factor = list(FACTORS.values())[axis]
    assert model(level, still, push)[axis].item() == pytest.approx(
        10 / (MASS[axis] + factor * ADDED[axis]), 1e-14
    )


def test_the_munk_moment_follows(plain, level, still, vector):
    """The water's momentum [X, Y, Z added] x velocity turns the bow: N = -(f_Y A22 - f_X A11) u v."""
    model = plain({"added_mass": FACTORS})
    turned = model(level, vector(0.8, 0.3, 0, 0, 0, 0), still)[5]
    assert turned.item() == pytest.approx(-(0.5 * 30 - 2 * 20) * 0.8 * 0.3 / (4 + 1.2 * 2.5), 1e-13)


def test_a_full_matrix_scales_with_the_geometric_mean_and_stays_positive_definite():
    vehicle = example_vehicle()
    root = np.sqrt(list(FACTORS.values()))
    scaled = replace(vehicle, added_mass=vehicle.added_mass * np.outer(root, root))
    assert np.linalg.eigvalsh(scaled.added_mass).min() > 0
    scene = make_scene(vehicle, "wrench")
    row = scene.inputs.each()[0]
    found = GreyBox(vehicle, actuation="wrench").with_effects({"added_mass": FACTORS})
    expected = GreyBox(scaled, actuation="wrench")(scene.eta, scene.nu, row.command)
    torch.testing.assert_close(found(scene.eta, scene.nu, row.command), expected, rtol=1e-12, atol=1e-13)
