"""What sensors without noise report of a state, when they are biased, askew or misplaced."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from auvnn.plants.independent.vectors import cross, matrix_of, mounted, quaternion_of

Array = NDArray[np.float64]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Reported:
    """Position (R, 3), quaternion (R, 4), linear and angular velocity and their derivatives (R, 3) each."""

    position: Array
    quaternion: Array
    v: Array
    turn: Array
    v_dot: Array
    turn_dot: Array


def _gyro(values: Values, seen: Reported, gravity: float) -> Reported:
    return replace(seen, turn=seen.turn + np.array([values[n] for n in "pqr"]))


def _vertical(values: Values, seen: Reported, gravity: float) -> Reported:
    # The world that the attitude refers to is itself turned, so the error comes last.
    tilt = Rotation.from_rotvec([values["north"], values["east"], 0.0]).as_matrix()
    return replace(seen, quaternion=quaternion_of(tilt @ matrix_of(seen.quaternion), seen.quaternion))


def _misaligned(values: Values, seen: Reported, gravity: float) -> Reported:
    sensor = mounted(values["roll"], values["pitch"], values["yaw"])
    # Rows of v times the matrix: components along the sensor's axes.
    return replace(seen, v=seen.v @ sensor, v_dot=seen.v_dot @ sensor)


def _arm(values: Values, seen: Reported, gravity: float) -> Reported:
    arm = np.broadcast_to([values[n] for n in "xyz"], seen.v.shape)
    return replace(seen, v=seen.v + cross(seen.turn, arm), v_dot=seen.v_dot + cross(seen.turn_dot, arm))


def _scaled(values: Values, seen: Reported, gravity: float) -> Reported:
    return replace(seen, v=seen.v * values["factor"], v_dot=seen.v_dot * values["factor"])


def _accelerometer(values: Values, seen: Reported, gravity: float) -> Reported:
    # It measures what is not gravity: the acceleration in an inertial frame less g, along its own axes.
    sensor = mounted(values["roll"], values["pitch"], 0.0)
    carried = cross(seen.turn, seen.v) - gravity * matrix_of(seen.quaternion)[:, 2, :]
    measured = (seen.v_dot + carried) @ sensor
    return replace(seen, v_dot=measured - carried)


SENSORS = {
    "gyro_bias": _gyro,
    "tilted_vertical": _vertical,
    "velocity_misalignment": _misaligned,
    "velocity_lever_arm": _arm,
    "velocity_scale": _scaled,
    "accelerometer_tilt": _accelerometer,
}
"""Effects on what is reported, in order of action."""


def report(effects: Mapping[str, Values], truth: Reported, gravity: float) -> Reported:
    """Return what is reported of a state.

    Args:
        effects: that act, name to parameters.
        truth: what sensors without effects would report.
        gravity: m/s2.
    """
    for name, values in effects.items():
        if name in SENSORS:
            truth = SENSORS[name](values, truth, gravity)
    return truth
