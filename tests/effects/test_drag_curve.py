"""Exponents of the drag: against steady speeds, and the same amount where both laws agree."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects.drag_curve import DragCurve
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

SPEED = 0.16 * np.sqrt(9.81)


@pytest.mark.parametrize("exponent", [1.5, 2.6])
def test_the_steady_speed_follows_the_exponent(exponent):
    drag, push = 80.0, 30.0
    vehicle = plain_vehicle(quadratic_damping=[drag, 1, 1, 1, 1, 1])
    model = GreyBox(vehicle, actuation="wrench").with_effects({"drag_curve": {"X": exponent}})
    times = torch.linspace(0, 60, 301).double()
    command = torch.tensor([push, 0, 0, 0, 0, 0]).double().expand(301, 6)
    eta = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double()
    run = model.rollout(eta, torch.zeros(6).double(), command, times)
    steady = SPEED * (push / (drag * SPEED**2)) ** (1.0 / exponent)
    assert float(run.nu[-1, 0]) == pytest.approx(steady, rel=1e-5)


def test_at_the_speed_where_both_agree_and_at_rest_nothing_changes():
    vehicle = plain_vehicle(quadratic_damping=[80, 90, 100, 2, 3, 4])
    bare = GreyBox(vehicle, actuation="wrench")
    model = bare.with_effects({"drag_curve": dict.fromkeys("XYZKMN", 1.6)})
    eta, still = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    for nu in (
        still,
        torch.tensor([SPEED, 0, 0, 0, 0, 0]).double(),
        torch.tensor([0, -SPEED, 0, 0, 0, 0]).double(),
    ):
        torch.testing.assert_close(model(eta, nu, still), bare(eta, nu, still), rtol=0, atol=1e-12)


def test_a_vehicle_without_quadratic_damping_lacks_it():
    assert DragCurve.lacks(plain_vehicle(), "wrench") == ("quadratic_damping",)
