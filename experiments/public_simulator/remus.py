"""Logs from the REMUS 100 of the PythonVehicleSimulator, with something changed that the model is not told of."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from logged import DURATION, NOISE, RATE, STEP, Changed, acceleration, measured, shares_off

FILE = "python_vehicle_simulator/vehicles/remus100.py"
# The vehicle has changed between commits: other limits, areas and damping, and a stern plane with the opposite sign.
COMMIT = "25b1e153fd4b694706f7059e4662eaab97c39ee0"
# The class has lags of 1 s on fins and propeller; newer versions of its MATLAB original have a tenth of that.
LAG = 0.1
# The class has fins whose lift is linear in their angle; with a stall so late, the model's are to 1e-3 up to 0.5 rad.
STALL = 1.5
# Propeller of the class, whose numbers stand inside its `dynamics`: diameter, K_T at J = 0 and 0.6632, wake, deduction.
DIAMETER, KT, KT_MAX, J_MAX, KQ, WAKE, DEDUCTION = 0.14, 0.4566, 0.1798, 0.6632, 0.07, 0.944, 0.1
# Ends between which settings are drawn: change of heading, rad, change of depth, m, and revolutions per minute.
SETTINGS = ((-1.5, 1.5), (-3.0, 4.0), (700.0, 1500.0))


def simulator(folder: Path) -> Any:
    """Return the module of the vehicle from a checkout of the simulator; another version of the vehicle is refused."""
    for place in (folder, folder / "src"):
        if (place / "python_vehicle_simulator" / "vehicles" / "remus100.py").exists():
            sys.path.insert(0, str(place))
            module = importlib.import_module("python_vehicle_simulator.vehicles.remus100")
            if not _is_known(module.remus100()):
                raise SystemExit(f"{folder}: another version of the vehicle; git checkout {COMMIT}")
            return module
    raise SystemExit(f"{folder}: no python_vehicle_simulator/vehicles/remus100.py in it or in its src")


def _is_known(vehicle: Any) -> bool:
    """Return whether limits and lags are those that the model file is written for, and a stern plane lifts the bow."""
    state, actual = np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.1, 1000.0])
    moved, _ = vehicle.dynamics(np.zeros(6), state, actual, actual, STEP)
    limits = (vehicle.deltaMax_r, vehicle.deltaMax_s, vehicle.T_delta, vehicle.T_n)
    return bool(np.allclose(limits, (math.pi / 6, math.pi / 6, 1.0, 1.0)) and moved[4] > 0.0)


class Plant(Changed):
    """The vehicle, with what is changed of it; its commands are rudder, stern plane and revolutions per minute."""

    commands = ("thruster_1", "fin_1", "fin_2")

    def vehicle(self) -> Any:
        """Return a new vehicle, as it is when a run begins."""
        made = self.module.remus100()
        made.T_delta = made.T_n = LAG
        if self.change is not None:
            self.change(made)
        return made

    def run(self, seed: int) -> np.ndarray:
        """Return the rows of one run, (samples, 1 + columns): the autopilot holds headings and depths in turn."""
        vehicle, rng = self.vehicle(), np.random.default_rng(seed)
        attitude_euler = importlib.import_module(
            f"{self.module.__name__.split('.')[0]}.lib.gnc"
        ).attitudeEuler
        eta, nu = np.array([0.0, 0.0, 8.0, 0.0, 0.0, rng.uniform(-3, 3)]), np.array([1.2, 0, 0, 0, 0, 0])
        actual, integral = np.array([0.0, 0.0, 1000.0]), np.zeros(2)
        until = rng.uniform(6, 14, 20).cumsum()
        aims = np.column_stack([rng.uniform(*ends, 21) for ends in SETTINGS]) + np.array(
            [eta[5], eta[2], 0.0]
        )
        rows, every, steps = [], round(1 / RATE / STEP), round(DURATION / STEP)
        for i in range(steps + 1):
            t = i * STEP
            if self.later is not None and i == steps // 2:
                self.later(vehicle)
            heading, depth, speed = aims[int(np.searchsorted(until, t))]
            given = _autopilot(eta, nu, heading, depth, speed, integral, rng)
            if i % every == 0:
                rows.append([t, *measured(eta, self.sensors(nu), rng), given[2] / vehicle.nMax, *given[:2]])
            moved, actual = vehicle.dynamics(eta, nu, actual, self.command(given), STEP)
            eta, nu = attitude_euler(eta, nu, STEP), moved
        return np.array(rows)


def _autopilot(
    eta: np.ndarray,
    nu: np.ndarray,
    heading: float,
    depth: float,
    speed: float,
    integral: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return rudder, stern plane, rad, and revolutions per minute; it sees states with noise of their own."""
    seen = eta[2:6] + rng.standard_normal(4) * [
        NOISE["depth"],
        NOISE["tilt"],
        NOISE["tilt"],
        NOISE["heading"],
    ]
    rate = nu[4:6] + NOISE["angular"] * rng.standard_normal(2)
    pitch = float(np.clip(0.15 * (seen[0] - depth), -0.5, 0.5))
    errors = np.array([seen[2] - pitch, (seen[3] - heading + math.pi) % (2 * math.pi) - math.pi])
    integral[:] = np.clip(integral + STEP * errors, -1.0, 1.0)
    stern = -(2.0 * errors[0] + 0.8 * rate[0] + 0.3 * integral[0])
    rudder = -(0.9 * errors[1] + 0.8 * rate[1] + 0.05 * integral[1])
    return np.array([*np.clip([rudder, stern], -0.5, 0.5), speed])


def description(vehicle: Any) -> dict[str, Any]:
    """Return the model file that its user would write: the class's own numbers, in the package's terms.

    What has no number in these terms is left to a fit: damping that fades with speed, drag across in one plane alone.
    The stern plane of the class pushes the stern up and the bow up; a fin does both where it stands ahead of the origin.
    """
    half, rho = vehicle.L / 2, float(vehicle.rho)
    area, inflow = 0.5 * rho * vehicle.S, rho * DIAMETER**4 * (1 - DEDUCTION)
    revolutions = vehicle.nMax / 60
    ratio = vehicle.diam**2 / vehicle.S
    lift = math.pi * ratio / (1 + math.sqrt(1 + (ratio / 2) ** 2))
    across = 0.5 * rho * vehicle.diam * 1.2
    # Fins of the package lift by the flow's angle too; that is taken off, the rudder being at -x, the stern plane at x.
    rudder, stern = (
        0.5 * rho * a * c for a, c in ((vehicle.A_r, vehicle.CL_delta_r), (vehicle.A_s, vehicle.CL_delta_s))
    )
    full = inflow * KT * revolutions**2
    inertia = np.diag(vehicle.MRB)[3:] - vehicle.MRB[0, 0] * vehicle.r_bg[2] ** 2 * np.array([1, 1, 0])
    settling = np.diag(vehicle.M) * [0, 0, 1 / vehicle.T_heave, 2 * vehicle.zeta_roll * vehicle.w_roll,
                                     2 * vehicle.zeta_pitch * vehicle.w_pitch, 0]  # fmt: skip
    along, sideways = np.diag(vehicle.MA)[:2].tolist()
    slopes = (1 / vehicle.CL_delta_r + 1 / vehicle.CL_delta_s) / 2
    quadratic = [area * vehicle.CD_0, across * vehicle.L, 3.0, 0.01, 0.01, 0.01]
    return {
        "name": "pvs-remus100",
        "frame": "FRD",
        "gravity": 9.81,
        "water_density": rho,
        "mass": float(vehicle.MRB[0, 0]),
        "buoyancy": float(vehicle.B),
        "length": vehicle.L,
        "center_of_gravity": vehicle.r_bg.tolist(),
        "center_of_buoyancy": vehicle.r_bb.tolist(),
        "inertia": np.diag(inertia).tolist(),
        "added_mass": vehicle.MA.tolist(),
        "linear_damping": np.diag(settling + np.array([0.05, 0.05, 0, 0, 0, 0.1])).tolist(),
        "quadratic_damping": np.diag(quadratic).tolist(),
        "thrusters": [
            {"position": [-half, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "max_forward": full, "max_reverse": full,
             "curve": "quadratic", "handedness": 1}
        ],
        "fins": [
            {"position": [-half, 0.0, 0.0], "axis": [0.0, 0.0, -1.0], "area": vehicle.A_r,
             "lift_slope": vehicle.CL_delta_r, "stall": STALL},
            {"position": [half, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "area": vehicle.A_s,
             "lift_slope": vehicle.CL_delta_s, "stall": STALL},
        ],
        "effects": {
            "thrust_inflow_loss": {"coefficient": inflow * (KT - KT_MAX) / J_MAX * WAKE / DIAMETER * revolutions},
            "propeller_torque": {"coefficient": KQ * DIAMETER / KT / (1 - DEDUCTION)},
            "munk_moment": {"pitch": -along / (sideways - along), "yaw": 0.0},
            "body_lift": {
                "Yuv": rudder,
                "Zuw": stern - area * (lift + vehicle.CD_0),
                "Muw": -half * stern,
                "Nuv": -half * rudder,
            },
            "turning_forces": {
                "Yur": -half * rudder,
                "Zuq": -half * stern,
                "Muq": half**2 * stern,
                "Nur": half**2 * rudder,
            },
            "cross_flow_drag": {"share": 1.0},
            "propeller_lag": {"time_constant": LAG},
            "fin_lag": {"time_constant": LAG},
            # The class has drag with the angle's square, by the lift's slope; this effect, by the lift's square.
            "fin_drag": {"zero_lift": 0.0, "induced": slopes, "uncertainty": {"induced": 0.2 * slopes}},
        },
        "uncertainty": {"added_mass": 0.1, "linear_damping": 0.3, "quadratic_damping": 0.3, "inertia": 0.05},
        "source": "PythonVehicleSimulator, remus100.py",
    }  # fmt: skip


def disagreement(vehicle: Any, model: Any, count: int = 400) -> list[float]:
    """Return the difference of the model's forces from the class's, as shares of these (rms), X to N, lags aside.

    Args:
        vehicle: of the simulator.
        model: of the same vehicle; its lags are left out.
        count: states that are drawn: 0.8 to 2.2 m/s ahead, 0.15 m/s across, 0.2 rad/s, 0.3 rad, fins at 0.2 rad.
    """
    effects = [e for e in model.copied_effects() if e.name not in ("propeller_lag", "fin_lag")]
    model, rng, both = model.rebuilt(effects), np.random.default_rng(0), []
    full = model.vehicle.thrusters[0].max_forward
    for _ in range(count):
        nu = np.array([rng.uniform(0.8, 2.2), *rng.normal(0, 0.15, 2), *rng.normal(0, 0.2, 3)])
        eta = np.array([0.0, 0.0, 8.0, *rng.normal(0, 0.3, 2), rng.uniform(-3, 3)])
        actual = np.array([*rng.normal(0, 0.2, 2), rng.uniform(700, 1500)])
        moved, _ = vehicle.dynamics(eta.copy(), nu.copy(), actual, actual, STEP)
        share = actual[2] / vehicle.nMax
        mine = acceleration(model, eta, nu, [share], [full * share**2], actual[:2])
        both.append(vehicle.M @ np.stack([mine, (moved - nu) / STEP], axis=1))
    return shares_off(both)
