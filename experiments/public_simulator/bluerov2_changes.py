"""What is hidden in the BlueROV2 Heavy of `bluerov2_dynamics`, by the names that it has in the catalogue."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from logged import turned, with_values


def _buoyant(vehicle: Any) -> None:
    vehicle.B += 3.0


def _heavier_water(vehicle: Any) -> None:
    # Half more of the water that moves along; its Coriolis forces too.
    vehicle.MA = 1.5 * vehicle.MA
    for name in ("Xu_dot", "Yv_dot", "Zw_dot", "Kp_dot", "Mq_dot", "Nr_dot"):
        setattr(vehicle, name, 1.5 * getattr(vehicle, name))
    _weighed(vehicle)


def _water_within(vehicle: Any) -> None:
    # Two kilograms that weigh nothing in water.
    vehicle.m += 2.0
    vehicle.MRB = vehicle.MRB + np.diag([2.0] * 3 + [0.0] * 3)
    _weighed(vehicle)


def _weighed(vehicle: Any) -> None:
    vehicle.M = vehicle.MRB + vehicle.MA
    vehicle.Minv = np.linalg.inv(vehicle.M)


def _more_drag(vehicle: Any) -> None:
    for name in ("Xu_abs", "Yv_abs", "Zw_abs", "Kp_abs", "Mq_abs", "Nr_abs"):
        setattr(vehicle, name, 1.5 * getattr(vehicle, name))


def _load(vehicle: Any) -> None:
    # Half a kilogram, 0.15 m ahead: the class has no centre of gravity but the origin, so its moment is the buoyancy's.
    weight = 0.5 * vehicle.g
    vehicle.m += 0.5
    vehicle.MRB = vehicle.MRB + np.diag([0.5] * 3 + [0.0, 0.5 * 0.15**2, 0.5 * 0.15**2])
    _weighed(vehicle)
    vehicle.W += weight
    vehicle.xb -= 0.15 * weight / vehicle.B


def _thrust(change: Callable[[float, int], float]) -> Callable[[Any], None]:
    """Return what changes the thrust of each thruster, N, by its number from 0."""

    def hide(vehicle: Any) -> None:
        given = vehicle._thruster_force_from_input
        vehicle._thruster_force_from_input = lambda command, i, dt: change(given(command, i, dt), i)

    return hide


def _slower(vehicle: Any) -> None:
    # The same transfer function, four times as slow.
    for lag in vehicle.thruster_lags:
        lag.step = lambda thrust, dt, step=lag.step: step(thrust, 0.25 * dt)


def _later(vehicle: Any) -> None:
    # By a tenth of a second: ten steps.
    given, queue = vehicle.compute_thruster_forces, deque([np.zeros(8)] * 10)

    def force(commands: np.ndarray, dt: float) -> np.ndarray:
        queue.append(np.array(commands))
        return given(queue.popleft(), dt)

    vehicle.compute_thruster_forces = force


def _dead(given: np.ndarray) -> np.ndarray:
    return np.sign(given) * np.maximum(np.abs(given) - 0.06, 0.0) / (1.0 - 0.06)


# What is hidden by the name that it has in the catalogue: what changes of the vehicle, its commands or its sensors.
CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "ocean_current": {"change": with_values(current_speed=np.array([0.15, -0.1, 0.0]))},
    "thruster_gain": {"change": _thrust(lambda thrust, i: 0.6 * thrust if i == 2 else thrust)},
    "thrust_asymmetry": {"change": _thrust(lambda thrust, i: 0.75 * thrust if thrust < 0.0 else thrust)},
    "thruster_deadband": {"command": _dead},
    "net_buoyancy": {"change": _buoyant},
    "added_mass": {"change": _heavier_water},
    "trapped_water": {"change": _water_within},
    "linear_damping": {"change": with_values(Yv=-30.0, Nr=-0.5)},
    "quadratic_damping": {"change": _more_drag},
    "cg_offset": {"change": with_values(xb=0.003)},
    "payload": {"later": _load},
    "thruster_lag": {"change": _slower},
    "actuation_delay": {"change": _later},
    "gyro_bias": {"sensors": lambda nu: nu + np.array([0, 0, 0, 0, 0, 0.01])},
    "velocity_scale": {"sensors": lambda nu: nu * [1.03, 1.03, 1.03, 1, 1, 1]},
    "velocity_misalignment": {"sensors": turned},
}
# The class lets a current act in the drag alone, which has a name of its own; the linear damping that is hidden is one
# that the model does not state at all, which has had one since these changes were first asked for.
ALSO = {"ocean_current": ("drag_only_current",), "linear_damping": ("unstated_damping",)}
