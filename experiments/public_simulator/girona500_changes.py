"""What is hidden in the Girona 500 of COLA2's simulator, by the names that it has in the catalogue."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from logged import turned, with_values


def _stream(vehicle: Any) -> None:
    # The class adds the current to the speed; its own function for that draws anew in each step, and cannot run with
    # the matrices of four rows that ROS returns.
    toward = np.array([-0.15, 0.1, 0.0])

    def flow() -> np.ndarray:
        (cr, cp, cy), (sr, sp, sy) = np.cos(vehicle.p[3:]), np.sin(vehicle.p[3:])
        turn = np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, sy * sr + cy * cr * sp],
                [sy * cp, cy * cr + sr * sp * sy, sp * sy * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
        return np.array([*(turn.T @ toward), 0.0, 0.0, 0.0])

    vehicle.compute_currents = flow


def _weaker(vehicle: Any) -> None:
    # The horizontal thruster to starboard.
    vehicle.thrusters_matrix = vehicle.thrusters_matrix * np.array([1.0, 0.7, 1.0, 1.0, 1.0])


def _dead(given: np.ndarray) -> np.ndarray:
    return np.sign(given) * np.maximum(np.abs(given) - 0.08, 0.0) / (1.0 - 0.08)


def _with_mass(vehicle: Any, mass: float, ahead: float = 0.0) -> None:
    """Let a mass move along: a point ahead of the origin."""
    more = np.diag([mass] * 3 + [0.0, mass * ahead**2, mass * ahead**2])
    more[2, 4] = more[4, 2] = -mass * ahead
    more[1, 5] = more[5, 1] = mass * ahead
    vehicle.M = vehicle.M + more
    vehicle.IM = np.linalg.inv(vehicle.M)


def _with_weight(vehicle: Any, weight: float, lever: float) -> None:
    """Add a weight, N, and a moment of weight about y, N m: that of the class has no lever but in depth."""
    given = vehicle.gravity

    def gravity(pos: np.ndarray) -> np.ndarray:
        # On the left of the class's equations; r x W with W along the vertical.
        roll, pitch = pos[3:5]
        down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
        return given(pos) - np.array([*(weight * down), 0.0, -lever * down[2], lever * down[1]])

    vehicle.gravity = gravity


def _heavier_water(vehicle: Any) -> None:
    # Half more of the water that moves along.
    _with_mass(vehicle, 0.25 * vehicle.mass)


def _off_centre(vehicle: Any) -> None:
    # The centre of gravity 5 mm ahead.
    ahead = 0.005 * vehicle.mass
    vehicle.M[2, 4] = vehicle.M[4, 2] = -ahead
    vehicle.M[1, 5] = vehicle.M[5, 1] = ahead
    vehicle.IM = np.linalg.inv(vehicle.M)
    _with_weight(vehicle, 0.0, ahead * vehicle.g)


def _load(vehicle: Any) -> None:
    # Three kilograms 0.3 m ahead.
    _with_mass(vehicle, 3.0, 0.3)
    _with_weight(vehicle, 3.0 * vehicle.g, 3.0 * vehicle.g * 0.3)


def _blunt(vehicle: Any) -> None:
    # Drag that grows with the power 1.6 of the speed, with the same coefficients.
    def drag(speed: np.ndarray) -> np.ndarray:
        grown = np.abs(speed) ** np.array([0.6, 0.6, 0.6, 1.0, 1.0, 1.0])
        return np.diag(np.array(vehicle.damping) + np.array(vehicle.quadratic_damping) * grown)

    vehicle.damping_matrix = drag


def _by_steps(vehicle: Any, slow: Any) -> None:
    """Let the revolutions of each step be those that a function of the class's own pair of set points returns."""
    given = vehicle.iterate

    def iterate() -> None:
        pair = vehicle.old_u, vehicle.u
        vehicle.old_u, vehicle.u = slow(*pair)
        given()
        vehicle.old_u, vehicle.u = pair

    vehicle.iterate = iterate


def _slower(vehicle: Any) -> None:
    actual = [np.zeros(5)]

    def lag(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Of 0.3 s, exact over a step, towards the mean that the class takes of both set points.
        then = actual[0]
        actual[0] = then + (1.0 - np.exp(-vehicle.period / 0.3)) * ((before + after) / 2 - then)
        return then, actual[0]

    _by_steps(vehicle, lag)


def _later(vehicle: Any) -> None:
    # By 0.15 s: fifteen steps.
    queue = deque([(np.zeros(5), np.zeros(5))] * 15)

    def delayed(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        queue.append((before, after))
        return queue.popleft()

    _by_steps(vehicle, delayed)


def _elsewhere(nu: np.ndarray) -> np.ndarray:
    # The velocity sensor stands 0.5 m aft of the origin.
    return np.array([*(nu[:3] + np.cross(nu[3:], [-0.5, 0.0, 0.0])), *nu[3:]])


# What is hidden by the name that it has in the catalogue: what changes of the vehicle, its commands or its sensors.
CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "ocean_current": {"change": _stream},
    "thruster_gain": {"change": _weaker},
    "thrust_asymmetry": {"change": lambda vehicle: with_values(ctb=0.75 * vehicle.ctb)(vehicle)},
    "thruster_deadband": {"command": _dead},
    "net_buoyancy": {"change": lambda vehicle: with_values(buoyancy=vehicle.buoyancy + 0.8)(vehicle)},
    "added_mass": {"change": _heavier_water},
    "trapped_water": {"change": lambda vehicle: _with_mass(vehicle, 12.0)},
    "unstated_damping": {"change": with_values(damping=[-30.0, -65.0, -30.0, -130.0, -130.0, -130.0])},
    "linear_damping": {"change": with_values(damping=[0.0, -120.0, 0.0, -130.0, -130.0, -230.0])},
    "quadratic_damping": {
        "change": with_values(quadratic_damping=[-260.0, -260.0, -260.0, -180.0, -180.0, -180.0])
    },
    "drag_curve": {"change": _blunt},
    "cg_offset": {"change": _off_centre},
    "payload": {"later": _load},
    "thruster_lag": {"change": _slower},
    "actuation_delay": {"change": _later},
    "gyro_bias": {"sensors": lambda nu: nu + np.array([0, 0, 0, 0, 0, 0.01])},
    "velocity_scale": {"sensors": lambda nu: nu * [1.04, 1.04, 1.04, 1, 1, 1]},
    "velocity_misalignment": {"sensors": turned},
    "velocity_lever_arm": {"sensors": _elsewhere},
}
# The class's inertia feels no current, which has a name of its own; and it is revolutions that lag there, which has
# another one than a thrust that does: that was seen when the answer was.
ALSO = {"ocean_current": ("drag_only_current",), "thruster_lag": ("propeller_lag",)}
