"""Tilted vertical: against scipy's rotations, and back again."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from auvnn.effects import Sensed


def test_the_reported_attitude_is_the_true_one_turned_in_the_world(plain):
    model = plain({"tilted_vertical": {"north": 0.05, "east": -0.08}})
    true = Rotation.random(20, random_state=1)
    zero = torch.zeros(20, 6).double()
    state = Sensed(zero[:, :3], torch.tensor(np.roll(true.as_quat(), 1, axis=1)), zero)
    seen = model.sense(state)
    expected = Rotation.from_rotvec([0.05, -0.08, 0.0]) * true
    found = Rotation.from_quat(np.roll(seen.quaternion.detach().numpy(), -1, axis=1))
    assert (found * expected.inv()).magnitude().max() < 1e-12
    back = model.unsense(seen, rounds=12).quaternion.detach().numpy()
    assert (Rotation.from_quat(np.roll(back, -1, axis=1)) * true.inv()).magnitude().max() < 1e-6


def test_roll_and_pitch_are_wrong_by_the_tilt_and_change_with_the_heading(plain):
    """Level and heading north a tilt about north is roll; heading east it is pitch, turned about."""
    model = plain({"tilted_vertical": {"north": 0.05}})
    headings = Rotation.from_euler("z", [[0.0], [np.pi / 2]])
    zero = torch.zeros(2, 6).double()
    seen = model.sense(Sensed(zero[:, :3], torch.tensor(np.roll(headings.as_quat(), 1, axis=1)), zero))
    yaw, pitch, roll = (
        Rotation.from_quat(np.roll(seen.quaternion.detach().numpy(), -1, axis=1)).as_euler("ZYX").T
    )
    np.testing.assert_allclose(roll, [0.05, 0.0], atol=1e-12)
    np.testing.assert_allclose(pitch, [0.0, -0.05], atol=1e-12)
    np.testing.assert_allclose(yaw, [0.0, np.pi / 2], atol=1e-12)
