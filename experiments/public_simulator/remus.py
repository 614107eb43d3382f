"""Logs from the REMUS 100 of the PythonVehicleSimulator, with something changed that the model is not told of."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

STEP, RATE, RUNS, DURATION = 0.01, 20, 3, 60.0
# The vehicle has changed between commits: other limits, areas and damping, and a stern plane with the opposite sign.
COMMIT = "25b1e153fd4b694706f7059e4662eaab97c39ee0"
# The class has lags of 1 s on fins and propeller; newer versions of its MATLAB original have a tenth of that.
LAG = 0.1
# The class has fins whose lift is linear in their angle; with a stall so late, the model's are to 1e-3 up to 0.5 rad.
STALL = 1.5
# Propeller of the class, whose numbers stand inside its `dynamics`: diameter, K_T at J = 0 and 0.6632, wake, deduction.
DIAMETER, KT, KT_MAX, J_MAX, KQ, WAKE, DEDUCTION = 0.14, 0.4566, 0.1798, 0.6632, 0.07, 0.944, 0.1
NOISE = {
    "linear": 0.006,
    "angular": 0.003,
    "tilt": 0.003,
    "heading": 0.008,
    "horizontal": 0.05,
    "depth": 0.01,
}
COLUMNS = (
    *("qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r", "x", "y", "z"),
    *("thruster_1", "fin_1", "fin_2"),
)
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


class Plant:
    """The vehicle, with what is changed of it.

    Args:
        module: of the simulator.
        change: of the vehicle's numbers, before it drives.
        command: of what is commanded, [rudder, stern plane, revolutions per minute].
        sensors: of velocities as they are logged, (6,).
        later: of the vehicle's numbers in the middle of a run.
    """

    def __init__(
        self,
        module: Any,
        change: Callable[[Any], None] | None = None,
        command: Callable[[np.ndarray], np.ndarray] | None = None,
        sensors: Callable[[np.ndarray], np.ndarray] | None = None,
        later: Callable[[Any], None] | None = None,
    ) -> None:
        """Keep what is changed: each run has a vehicle of its own."""
        self.kinematics = importlib.import_module(f"{module.__name__.split('.')[0]}.lib.gnc").attitudeEuler
        self.module, self.change = module, change
        self.command = command or (lambda given: given)
        self.sensors = sensors or (lambda nu: nu)
        self.later = later

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
                rows.append([t, *_measured(eta, self.sensors(nu), rng), given[2] / vehicle.nMax, *given[:2]])
            moved, actual = vehicle.dynamics(eta, nu, actual, self.command(given), STEP)
            eta, nu = self.kinematics(eta, nu, STEP), moved
        return np.array(rows)

    def write(self, path: Path, seed: int) -> Path:
        """Write a log of all runs."""
        import polars

        runs = [self.run(100 * seed + k) for k in range(RUNS)]
        rows = np.concatenate(runs)
        numbers = np.repeat(np.arange(RUNS), [len(r) for r in runs])
        columns = {"run": numbers, "t": rows[:, 0], **{c: rows[:, 1 + k] for k, c in enumerate(COLUMNS)}}
        polars.DataFrame(columns).write_parquet(path)
        return path


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


def _measured(eta: np.ndarray, nu: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return quaternion, velocities and position with the noise of usual sensors."""
    noise = rng.standard_normal(12)
    turn = eta[3:] + noise[:3] * [NOISE["tilt"], NOISE["tilt"], NOISE["heading"]]
    (cr, cp, cy), (sr, sp, sy) = np.cos(turn / 2), np.sin(turn / 2)
    attitude = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    velocity = nu + noise[3:9] * ([NOISE["linear"]] * 3 + [NOISE["angular"]] * 3)
    place = eta[:3] + noise[9:] * [NOISE["horizontal"], NOISE["horizontal"], NOISE["depth"]]
    return np.concatenate([attitude, velocity, place])


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
        model: of the same vehicle, without lags.
        count: states that are drawn: 0.8 to 2.2 m/s ahead, 0.15 m/s across, 0.2 rad/s, 0.3 rad, fins at 0.2 rad.
    """
    import torch

    from auvnn.models import Inputs
    from auvnn.physics.attitude import euler_to_quat, quat_to_matrix

    rng, forces = np.random.default_rng(0), []
    full = model.vehicle.thrusters[0].max_forward
    for _ in range(count):
        nu = np.array([rng.uniform(0.8, 2.2), *rng.normal(0, 0.15, 2), *rng.normal(0, 0.2, 3)])
        eta = np.array([0.0, 0.0, 8.0, *rng.normal(0, 0.3, 2), rng.uniform(-3, 3)])
        actual = np.array([*rng.normal(0, 0.2, 2), rng.uniform(700, 1500)])
        moved, _ = vehicle.dynamics(eta.copy(), nu.copy(), actual, actual, STEP)
        share = actual[2] / vehicle.nMax
        at, speed, command, thrust, fins, now = (
            torch.tensor(x, dtype=torch.float64)
            for x in (eta, nu, [share], [full * share**2], actual[:2], 0.0)
        )
        turned = quat_to_matrix(euler_to_quat(at[3:]))
        with torch.no_grad():
            mine = model.nu_dot(at[:3], turned, speed, thrust, Inputs(command, fins), now).numpy()
        forces.append(vehicle.M @ np.stack([mine, (moved - nu) / STEP], axis=1))
    mine, theirs = np.stack(forces).transpose(2, 0, 1)
    return (np.sqrt(((mine - theirs) ** 2).mean(0)) / np.sqrt((theirs**2).mean(0))).tolist()
