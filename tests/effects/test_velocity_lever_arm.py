"""Velocity lever arm: against omega x r, and the velocity of a point that is followed through a free run."""

from __future__ import annotations

import pytest
import torch

from auvnn.effects import Sensed
from auvnn.models import GreyBox
from auvnn.physics.attitude import quat_rotate, quat_rotate_inverse
from auvnn.vehicle import load_vehicle

ARM = {"x": 0.4, "y": -0.2, "z": 0.1}


def sensed(nu, rate=None):
    return Sensed(
        torch.zeros(3, dtype=torch.float64), torch.tensor([1.0, 0, 0, 0], dtype=torch.float64), nu, rate
    )


@pytest.mark.parametrize(
    ("turn", "expected"),
    [((0, 0, 0.5), (0.1, 0.2, 0)), ((0, 0.5, 0), (0.05, 0, -0.2)), ((0.5, 0, 0), (0, -0.05, -0.1))],
)
def test_in_pure_rotation_it_reports_omega_cross_r(plain, vector, turn, expected):
    model = plain({"velocity_lever_arm": ARM})
    seen = model.sense(sensed(vector(0, 0, 0, *turn), vector(0, 0, 0, *turn)))
    assert seen.nu.tolist() == pytest.approx([*expected, *turn], abs=1e-15)
    assert seen.nu_dot.tolist() == pytest.approx([*expected, *turn], abs=1e-15)


def test_the_motion_itself_does_not_change(plain, level, still, vector):
    nu, command = vector(0.5, 0.1, -0.2, 0.2, 0.3, -0.4), vector(1, 2, 3, 0.1, 0.2, 0.3)
    assert torch.equal(plain({"velocity_lever_arm": ARM})(level, nu, command), plain()(level, nu, command))


def test_it_is_the_velocity_of_the_place_of_the_sensor():
    """Follow p + R r through a free run and differentiate; the same for what it says about accelerations."""
    model = GreyBox(load_vehicle("rov95"), actuation="wrench").with_effects({"velocity_lever_arm": ARM})
    arm = torch.tensor(list(ARM.values()), dtype=torch.float64)
    step = 1e-3
    times = torch.arange(0, 0.5, step, dtype=torch.float64)
    commands = torch.tensor([60.0, -40, 30, 8, -6, 9], dtype=torch.float64).expand(len(times), 6)
    start = torch.tensor([0.5, -0.2, 0.1, 0.3, -0.4, 0.6], dtype=torch.float64)
    with torch.no_grad():
        run = model.rollout(torch.zeros(6, dtype=torch.float64), start, commands, times)
        rates = model(run.eta, run.nu, commands)
        seen = model.sense(Sensed(run.eta[:, :3], run.eta[:, 3:], run.nu, rates))
    place = run.eta[:, :3] + quat_rotate(run.eta[:, 3:], arm.expand(len(times), 3))
    speed = quat_rotate_inverse(run.eta[1:-1, 3:], (place[2:] - place[:-2]) / (2 * step))
    torch.testing.assert_close(seen.nu[1:-1, :3], speed, rtol=0, atol=2e-6)
    change = (seen.nu[2:] - seen.nu[:-2]) / (2 * step)
    torch.testing.assert_close(seen.nu_dot[1:-1], change, rtol=0, atol=2e-5)


def test_what_was_reported_can_be_undone(plain, vector):
    model = plain({"velocity_lever_arm": ARM})
    state = sensed(vector(0.5, 0.1, -0.2, 0.2, 0.3, -0.4), vector(1, 2, 3, 0.1, 0.2, 0.3))
    back = model.unsense(model.sense(state))
    torch.testing.assert_close(back.nu, state.nu, rtol=0, atol=1e-15)
    torch.testing.assert_close(back.nu_dot, state.nu_dot, rtol=0, atol=1e-15)
