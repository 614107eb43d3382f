"""Gyroscope, velocity and acceleration sensors: against what such a sensor reads, worked out with scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.effects import Sensed
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

RANDOM = np.random.default_rng(5)
QUATERNION = RANDOM.normal(size=(8, 4))
QUATERNION /= np.linalg.norm(QUATERNION, axis=1, keepdims=True)
NU, RATE = RANDOM.normal(size=(8, 6)), RANDOM.normal(size=(8, 6))


def report(effects):
    model = GreyBox(plain_vehicle(), actuation="wrench").with_effects(effects)
    sensed = Sensed(torch.zeros(8, 3).double(), *(torch.tensor(x) for x in (QUATERNION, NU, RATE)))
    with torch.no_grad():
        return model.sense(sensed)


def test_a_bias_adds_to_the_rates_and_to_nothing_else():
    seen = report({"gyro_bias": {"p": 0.01, "q": -0.02, "r": 0.005}})
    np.testing.assert_allclose(
        seen.nu.numpy() - NU, np.tile([0, 0, 0, 0.01, -0.02, 0.005], (8, 1)), atol=1e-15
    )
    assert np.array_equal(seen.nu_dot.numpy(), RATE) and np.array_equal(seen.quaternion.numpy(), QUATERNION)


def test_a_scale_multiplies_translation_and_its_derivative():
    seen = report({"velocity_scale": {"factor": 1.04}})
    for got, true in ((seen.nu, NU), (seen.nu_dot, RATE)):
        np.testing.assert_allclose(
            got.numpy(), np.concatenate([1.04 * true[:, :3], true[:, 3:]], 1), rtol=1e-14
        )


def test_a_turned_sensor_reports_along_its_own_axes():
    angles = {"yaw": 0.3, "pitch": -0.1, "roll": 0.2}
    sensor = Rotation.from_euler("ZYX", list(angles.values()))
    seen = report({"velocity_misalignment": angles})
    for got, true in ((seen.nu, NU), (seen.nu_dot, RATE)):
        np.testing.assert_allclose(
            got.numpy()[:, :3], sensor.inv().apply(true[:, :3]), rtol=1e-12, atol=1e-14
        )
        assert np.array_equal(got.numpy()[:, 3:], true[:, 3:])


def test_a_sensor_turned_to_starboard_sees_forward_motion_from_port():
    seen = report({"velocity_misalignment": {"yaw": 0.01}}).nu.numpy()
    first_order = NU[:, :3] - np.cross([0, 0, 0.01], NU[:, :3])
    assert seen[:, :3] == pytest.approx(first_order, abs=3e-4)


def test_a_tilted_accelerometer_mistakes_part_of_gravity_for_motion():
    """Specific force f = a - g, both inertial and in body axes; a = dv/dt + omega x v."""
    tilt = {"roll": 0.02, "pitch": -0.015}
    sensor = Rotation.from_euler("ZYX", [0.0, tilt["pitch"], tilt["roll"]])
    body = Rotation.from_quat(QUATERNION[:, [1, 2, 3, 0]])
    gravity = body.inv().apply([0, 0, 9.81])
    turning = np.cross(NU[:, 3:], NU[:, :3])
    read = sensor.inv().apply(RATE[:, :3] + turning - gravity)
    seen = report({"accelerometer_tilt": tilt})
    np.testing.assert_allclose(seen.nu_dot.numpy()[:, :3], read + gravity - turning, rtol=1e-10, atol=1e-12)
    assert np.array_equal(seen.nu.numpy(), NU)


def test_one_degree_is_a_sixth_of_a_metre_per_second_squared():
    level = Sensed(*(torch.tensor(x) for x in (np.zeros(3), np.eye(4)[0], np.zeros(6), np.zeros(6))))
    model = GreyBox(plain_vehicle(), actuation="wrench")
    seen = model.with_effects({"accelerometer_tilt": {"pitch": np.radians(1.0)}}).sense(level)
    assert seen.nu_dot[0].item() == pytest.approx(9.81 * np.sin(np.radians(1.0)), rel=1e-12)
