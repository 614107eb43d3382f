"""Thrust by the advance ratio: half of the loss where it is said, its sides, and none at the bollard."""

from __future__ import annotations

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

THRUSTER = {
    "position": [0.0, 0.0, 0.0],
    "direction": [1.0, 0.0, 0.0],
    "max_forward": 100.0,
    "max_reverse": 60.0,
}


def thrust(command, speed, loss=0.4, half=1.2):
    """Return the thrust, N, at a command and a forward speed."""
    vehicle = plain_vehicle(thrusters=[THRUSTER])
    model = GreyBox(vehicle).with_effects({"thrust_advance": {"loss": loss, "speed": half}})
    eta, nu = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double(), torch.tensor([speed, 0, 0, 0, 0, 0]).double()
    with torch.no_grad():
        rate = model(eta, nu, torch.tensor([command]).double())
    return float(rate[0]) * 70.0


def test_half_of_the_loss_at_the_stated_inflow():
    assert thrust(1.0, 0.0) == pytest.approx(100.0)
    assert thrust(1.0, 1.2) == pytest.approx(100.0 * (1 - 0.4 / 2), rel=1e-8)
    # At half the command the same advance ratio is at half the speed.
    assert thrust(0.5, 0.6) == pytest.approx(25.0 * (1 - 0.4 / 2), rel=1e-8)
    # Much inflow at little command: the whole loss, and no more.
    assert thrust(0.01, 50.0) == pytest.approx(0.01 * (1 - 0.4), rel=1e-3)


def test_against_the_inflow_it_gains_and_in_reverse_too():
    assert thrust(1.0, -1.2) == pytest.approx(100.0 * (1 + 0.2), rel=1e-8)
    assert thrust(-1.0, 1.2) == pytest.approx(-60.0 * (1 + 0.2), rel=1e-8)
    assert thrust(-1.0, -1.2) == pytest.approx(-60.0 * (1 - 0.2), rel=1e-8)
    assert thrust(0.0, 1.0) == 0.0
