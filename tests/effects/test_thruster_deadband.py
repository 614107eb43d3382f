"""Thruster dead band: against the curve of a thruster, point by point."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

UNIT = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}


@pytest.mark.parametrize("width", [0.0, 0.1, 0.35])
def test_thrust_counts_from_the_edge_and_is_full_at_full_command(level, still, width):
    model = GreyBox(plain_vehicle(thrusters=[UNIT]))
    model = model.with_effects({"thruster_deadband": {"width": width}})
    for c in (-1.0, -0.6, -width, -0.5 * width, 0.0, 0.99 * width, 0.2 + width, 1.0):
        beyond = max(abs(c) - width, 0.0) / (1 - width)
        expected = (40.0 if c > 0 else -30.0) * beyond**2 / 70
        rate = model(level, still, torch.tensor([c], dtype=torch.float64))
        assert rate[0].item() == pytest.approx(expected, abs=1e-15)


def test_the_slope_at_the_null_is_that_of_a_narrow_band(level, still):
    """With w small, T = F (|c| - w)^2 / (1 - w)^2, so dT/dw = -2 F |c| (1 - |c|)."""
    model = GreyBox(plain_vehicle(thrusters=[UNIT])).with_effects(["thruster_deadband"])
    rate = model(level, still, torch.tensor([0.6], dtype=torch.float64))[0]
    (slope,) = torch.autograd.grad(rate, model.effects[0].theta)
    assert slope.item() == pytest.approx(-2 * 40 * 0.6 * 0.4 / 70, rel=1e-12)


def test_a_commanded_wrench_is_cut_in_each_degree_of_freedom(plain, level, still):
    """Without thrusters full effort is a tenth of the weight, at half the length."""
    full = np.array([49.05] * 3 + [24.525] * 3)
    command = np.array([20.0, -3.0, 60.0, 2.0, -12.0, 24.0])
    model = plain({"thruster_deadband": {"width": 0.1}})
    size = np.abs(command) / full
    kept = np.where(size < 1, np.maximum(size - 0.1, 0) / 0.9, size) * full * np.sign(command)
    expected = kept / np.array([70, 80, 90, 3, 4.5, 6.5])
    np.testing.assert_allclose(model(level, still, torch.tensor(command)).detach(), expected, rtol=1e-12)
