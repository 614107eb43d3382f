"""Quadratic-damping factors: against hyperbolic decay, and the power that drag takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene

FACTORS = {"X": 2.0, "Y": 0.5, "Z": 1.5, "K": 3.0, "M": 0.8, "N": 1.2}
INERTIA, DRAG = [70, 80, 90, 3, 4.5, 6.5], [20, 30, 40, 2, 3, 4]


@pytest.mark.parametrize("axis", range(6))
def test_motion_along_one_axis_decays_at_the_scaled_rate(plain, level, still, axis):
    """m du/dt = -f q u|u| has the solution u0 / (1 + f q u0 t / m)."""
    model = plain({"quadratic_damping": FACTORS}, quadratic_damping=DRAG)
    start = still.clone()
    start[axis] = 0.5
    times = torch.tensor([0.0, 0.2, 0.35, 0.6, 1.0], dtype=torch.float64)
    run = model.rollout(level, start, torch.zeros(5, 6, dtype=torch.float64), times, max_step=0.01)
    rate = list(FACTORS.values())[axis] * DRAG[axis] / INERTIA[axis]
    for t, nu in zip(times.tolist(), run.nu, strict=True):
        assert nu[axis].item() == pytest.approx(0.5 / (1 + rate * 0.5 * t), 1e-9)


def test_an_equal_factor_on_all_axes_multiplies_the_power_of_matrix_and_elements():
    vehicle = example_vehicle()
    none = replace(vehicle, linear_damping=None, damping_elements=tuple(
        replace(e, linear=np.zeros(6)) for e in vehicle.damping_elements))  # fmt: skip
    scene = make_scene(vehicle, "wrench")
    powers = []
    for factor in (1.0, 2.5):
        model = GreyBox(none, actuation="wrench").with_effects(
            {"quadratic_damping": dict.fromkeys(FACTORS, factor)}
        )
        rotation = torch.eye(3, dtype=torch.float64).expand(4, 3, 3)
        zero = torch.zeros(4, 6, dtype=torch.float64)
        row = scene.inputs.each()[0]
        terms = model.wrenches(scene.eta[:, :3], rotation, scene.nu, zero, row, scene.times[0])
        drag = terms["quadratic damping"] + terms["damping elements"]
        powers.append((drag * scene.nu).sum(-1))
    assert (powers[0] < 0).all()
    torch.testing.assert_close(powers[1], 2.5 * powers[0], rtol=1e-13, atol=0)


def test_linear_damping_stays_what_it_is(plain, level, vector, still):
    model, bare = plain({"quadratic_damping": FACTORS}, linear_damping=DRAG), plain(linear_damping=DRAG)
    nu = vector(0.5, 0.3, -0.2, 0.1, 0.2, -0.3)
    assert torch.equal(model(level, nu, still), bare(level, nu, still))
