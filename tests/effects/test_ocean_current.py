"""Ocean current: against drifting, a vehicle held in a stream, and Galileo's change of frame."""

from __future__ import annotations

import math

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.physics.attitude import quat_rotate, quat_rotate_inverse
from auvnn.testing import example_vehicle, make_scene


def test_drifting_with_the_current_nothing_happens(plain, vector, still):
    model = plain({"ocean_current": {"v_north": 0.4, "v_east": -0.3, "v_down": 0.1}},
                  linear_damping=[5, 6, 7, 1, 1, 1], quadratic_damping=[20, 30, 40, 2, 2, 2],
                  center_of_buoyancy=[0, 0, -0.05])  # fmt: skip
    psi = 0.7
    # The current seen from a vehicle with heading psi: turn the world vector back by psi.
    nu = vector(
        0.4 * math.cos(psi) - 0.3 * math.sin(psi), -0.4 * math.sin(psi) - 0.3 * math.cos(psi), 0.1, 0, 0, 0
    )
    assert model(vector(0, 0, 5, 0, 0, psi), nu, still).abs().max() < 1e-14


def test_a_northward_stream_pushes_a_resting_vehicle_north(plain, vector, level, still):
    speed = 0.5
    model = plain({"ocean_current": {"v_north": speed}}, linear_damping=[5, 6, 7, 1, 1, 1],
                  quadratic_damping=[20, 30, 40, 2, 2, 2])  # fmt: skip
    force = 5 * speed + 20 * speed**2
    assert model(level, still, still)[0].item() == force / (50 + 20)
    # Heading east the same water comes from port, and heading south from astern.
    east = model(vector(0, 0, 0, 0, 0, math.pi / 2), still, still)
    torch.testing.assert_close(
        east[1], vector(-(6 * speed + 30 * speed**2) / (50 + 30))[0], rtol=1e-12, atol=0
    )
    south = model(vector(0, 0, 0, 0, 0, math.pi), still, still)
    torch.testing.assert_close(south[0], vector(-force / 70)[0], rtol=1e-12, atol=0)


def test_it_is_a_change_of_the_frame_of_reference():
    """In the frame that moves with the water there is no current: nu_dot = f(nu - nu_c) - omega x R' v_c."""
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "thrusters", runs=20)
    stream = torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64)
    values = dict(zip(("v_north", "v_east", "v_down"), stream.tolist(), strict=True))
    bare = GreyBox(vehicle)
    model = bare.with_effects({"ocean_current": values})
    row = scene.inputs.each()[0]
    seen = quat_rotate_inverse(scene.eta[:, 3:], stream.expand(20, 3))
    relative = scene.nu - torch.cat([seen, torch.zeros(20, 3, dtype=torch.float64)], dim=-1)
    expected = bare(scene.eta, relative, row.command, fins=row.fins)
    expected[:, :3] -= torch.linalg.cross(scene.nu[:, 3:], seen)
    found = model(scene.eta, scene.nu, row.command, fins=row.fins)
    torch.testing.assert_close(found, expected, rtol=1e-11, atol=1e-12)


def test_a_free_run_ends_up_moving_with_the_water(plain, still, level):
    """Whatever way Munk's moment has turned it by then."""
    model = plain({"ocean_current": {"v_north": 0.3, "v_east": 0.2}}, linear_damping=[40.0] * 3 + [9.0] * 3)
    times = torch.arange(0, 30, 0.5, dtype=torch.float64)
    with torch.no_grad():
        run = model.rollout(
            level, still, torch.zeros(len(times), 6, dtype=torch.float64), times, max_step=0.5
        )
    over_ground = quat_rotate(run.eta[-1, 3:], run.nu[-1, :3])
    assert over_ground.tolist() == pytest.approx([0.3, 0.2, 0], abs=1e-5)
    assert run.nu[-1, 5].abs() < 1e-5
