"""What is hidden in the REMUS 100 of the PythonVehicleSimulator, by the names that it has in the catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
from logged import with_values


def _buoyant(vehicle: Any) -> None:
    vehicle.B = vehicle.W + 3.0


def _more_added_mass(vehicle: Any) -> None:
    # Its damping goes by the whole mass, and stays as it is.
    vehicle.MA = 1.5 * vehicle.MA
    vehicle.Minv = np.linalg.inv(vehicle.MRB + vehicle.MA)


def _more_drag(vehicle: Any) -> None:
    vehicle.CD_0 *= 1.5


def _off_centre(vehicle: Any) -> None:
    vehicle.r_bg = vehicle.r_bg + np.array([0.0, 0.003, 0.0])


def _weak_fins(vehicle: Any) -> None:
    vehicle.CL_delta_r, vehicle.CL_delta_s = 0.75 * vehicle.CL_delta_r, 0.75 * vehicle.CL_delta_s


def _load(vehicle: Any) -> None:
    # Half a kilogram at the bow.
    mass, place = 0.5, np.array([0.5, 0.0, 0.05])
    cross = np.array([[0, -place[2], place[1]], [place[2], 0, -place[0]], [-place[1], place[0], 0]])
    moved = np.eye(6)
    moved[:3, 3:] = cross.T
    weight = vehicle.MRB[0, 0]
    vehicle.MRB = vehicle.MRB + moved.T @ np.diag([mass] * 3 + [0] * 3) @ moved
    vehicle.Minv = np.linalg.inv(vehicle.MRB + vehicle.MA)
    vehicle.r_bg = (weight * vehicle.r_bg + mass * place) / (weight + mass)
    vehicle.W += 9.81 * mass


# What is hidden by the name that it has in the catalogue: what changes of the vehicle, its commands or its sensors.
CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "ocean_current": {"change": with_values(V_c=0.3, beta_c=1.0)},
    "thruster_gain": {"command": lambda given: given * [1.0, 1.0, 0.8**0.5]},
    "net_buoyancy": {"change": _buoyant},
    "added_mass": {"change": _more_added_mass},
    "cg_offset": {"change": _off_centre},
    "quadratic_damping": {"change": _more_drag},
    "fin_gain": {"change": _weak_fins},
    "fin_offset": {"command": lambda given: given + np.array([0.05, 0.0, 0.0])},
    "fin_lag": {"change": with_values(T_delta=0.4)},
    "propeller_lag": {"change": with_values(T_n=0.6)},
    "payload": {"later": _load},
    "gyro_bias": {"sensors": lambda nu: nu + np.array([0, 0, 0, 0, 0, 0.01])},
    "velocity_scale": {"sensors": lambda nu: nu * [1.03, 1.03, 1.03, 1, 1, 1]},
}
