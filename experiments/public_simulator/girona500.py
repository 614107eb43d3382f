"""Logs from the Girona 500 of COLA2's simulator, with something changed that the model is not told of."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
from logged import DURATION, NOISE, RATE, STEP, Changed, acceleration, measured, shares_off

FILE = "cola2_sim/src/dynamics.py"
COMMIT = "00da9e9a6ba109b0060388ea807acde2615fe68f"
# Seconds between two set points: those of the vehicle's own controllers.
PERIOD = 0.1
# Of full revolutions, the most that is commanded.
MOST = 0.95
# Ends of settings: forces ahead and across, N, change of depth, m, pitch and change of heading, rad.
SETTINGS = ((-70.0, 100.0), (-50.0, 50.0), (-1.5, 1.5), (-0.12, 0.12), (-1.5, 1.5))
# Of the autopilot in heave, pitch, yaw: force or moment per error, per speed, and the most of it.
GAIN, AGAINST = np.array([150.0, 60.0, 60.0]), np.array([100.0, 20.0, 20.0])
FORCE = np.array([80.0, 12.0, 40.0])
# What the class asks of ROS; none of it moves the vehicle but its parameters and the wrapping of angles.
ROS = (
    "rospy", "tf", "nav_msgs", "nav_msgs.msg", "cola2_msgs", "cola2_msgs.msg", "cola2_sim", "cola2_sim.srv",
    "cola2_lib", "cola2_lib.utils", "cola2_lib.utils.angles", "cola2_lib.rosutils", "cola2_lib.rosutils.param_loader",
)  # fmt: skip


def simulator(folder: Path) -> Any:
    """Return the module of the vehicle from a checkout, without ROS; another version of the vehicle is refused."""
    path = folder / FILE
    if not path.exists():
        raise SystemExit(f"{folder}: no {FILE} in it")
    spec = importlib.util.spec_from_file_location("cola2_dynamics", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with _without_ros():
        spec.loader.exec_module(module)
    if not _is_known(module.Dynamics("g500")):
        raise SystemExit(f"{folder}: another version of the vehicle; git checkout {COMMIT}")
    return module


@contextmanager
def _without_ros() -> Iterator[None]:
    """Let the class be imported where there is no ROS: its parameters are those that it states itself."""
    before = {name: sys.modules.get(name) for name in ROS}
    modules = {name: MagicMock() for name in ROS}
    loader = modules["cola2_lib.rosutils.param_loader"]
    loader.get_ros_params = _stated
    modules["cola2_lib.rosutils"].param_loader = loader
    modules["cola2_lib.utils.angles"].wrap_angle = lambda angle: (angle + np.pi) % (2 * np.pi) - np.pi
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name, module in before.items():
            sys.modules.pop(name)
            if module is not None:
                sys.modules[name] = module


def _stated(vehicle: Any, parameters: dict[str, tuple[str, Any]]) -> None:
    for name, (_, value) in parameters.items():
        setattr(vehicle, name, value)


def _is_known(vehicle: Any) -> bool:
    """Return whether numbers are as this study takes them: drag below zero, five thrusters, set points that blend."""
    still = np.shape(vehicle.thrusters_matrix) == (6, 5) and len(vehicle.old_u) == 5
    return bool(still and max(vehicle.quadratic_damping) < 0.0 and vehicle.M[0, 0] == 1.5 * vehicle.mass)


class Plant(Changed):
    """The vehicle, with what is changed of it; its commands are those of five thrusters, shares of full revolutions."""

    commands = tuple(f"thruster_{i + 1}" for i in range(5))

    def vehicle(self) -> Any:
        """Return a new vehicle, as it is when a run begins."""
        made = self.module.Dynamics("g500")
        made.pub_odometry = lambda: None
        if self.change is not None:
            self.change(made)
        return made

    def run(self, seed: int) -> np.ndarray:
        """Return the rows of one run, (samples, 1 + columns).

        A pilot pushes ahead and across; depth, pitch and heading are held, at values that change.
        """
        vehicle, rng = self.vehicle(), np.random.default_rng(seed)
        vehicle.p, vehicle.v = np.array([0.0, 0.0, 5.0, 0.0, 0.0, rng.uniform(-3, 3)]), np.zeros(6)
        until = rng.uniform(4, 10, 30).cumsum()
        aims = np.column_stack([rng.uniform(*ends, 31) for ends in SETTINGS])
        aims[:, 2] += vehicle.p[2]
        aims[:, 4] += vehicle.p[5]
        # The controllers know the vehicle as it was.
        known = self.module.Dynamics("g500")
        pushed, shares = np.zeros(2), np.linalg.pinv(known.thrusters_matrix)
        full, each = known.ctf, known.max_thrusters_rpm
        rows, every, often, steps = [], round(1 / RATE / STEP), round(PERIOD / STEP), round(DURATION / STEP)
        given = np.zeros(5)
        for i in range(steps + 1):
            t = i * STEP
            if self.later is not None and i == steps // 2:
                self.later(vehicle)
            if i % often == 0:
                aim = aims[int(np.searchsorted(until, t))]
                # A hand on a joystick takes a fifth of a second.
                pushed += PERIOD / 0.2 * (aim[:2] - pushed)
                heave, pitch, yaw = _autopilot(vehicle.p, vehicle.v, aim[2:], rng)
                thrust = shares @ np.array([*pushed, heave, 0.0, pitch, yaw])
                turns = np.sign(thrust) * np.sqrt(np.abs(thrust) / full) / each
                given = np.clip(turns, -MOST, MOST)
                vehicle.update_thrusters(SimpleNamespace(setpoints=each * self.command(given)))
            if i % every == 0:
                rows.append([t, *measured(vehicle.p, self.sensors(vehicle.v), rng), *given])
            vehicle.iterate()
        return np.array(rows)


def _autopilot(p: np.ndarray, v: np.ndarray, aim: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the force in heave, N, and the moments in pitch and yaw, N m; it sees states with noise of their own."""
    levels = [NOISE["depth"], NOISE["tilt"], NOISE["heading"]]
    errors = aim - p[[2, 4, 5]] - levels * rng.standard_normal(3)
    errors[1:] = (errors[1:] + np.pi) % (2 * np.pi) - np.pi
    seen = v[[2, 4, 5]] + [NOISE["linear"], *[NOISE["angular"]] * 2] * rng.standard_normal(3)
    return np.clip(GAIN * errors - AGAINST * seen, -FORCE, FORCE)


def description(vehicle: Any) -> dict[str, Any]:
    """Return the model file that its user would write: the class's own numbers, in the package's terms.

    The class's tensor is about the origin, and its thrust goes with the square of revolutions. Where a thruster stands
    is what the columns of its matrix say: a column is the force and the moment of one newton.
    """
    along = np.array(vehicle.thrusters_matrix, float)
    centre = np.array(vehicle.gravity_center, float)
    about = np.eye(3) * (centre @ centre) - np.outer(centre, centre)
    inertia = np.reshape(vehicle.tensor, (3, 3)) - vehicle.mass * about
    most = {
        way: k * vehicle.max_thrusters_rpm**2
        for way, k in (("max_forward", vehicle.ctf), ("max_reverse", vehicle.ctb))
    }
    return {
        "name": "cola2-girona500",
        "frame": "FRD",
        "gravity": vehicle.g,
        "water_density": vehicle.density,
        "mass": float(vehicle.mass),
        "buoyancy": float(vehicle.buoyancy * vehicle.g),
        "length": 1.5,
        "center_of_gravity": centre.tolist(),
        "center_of_buoyancy": [0.0, 0.0, 0.0],
        "inertia": inertia.tolist(),
        "added_mass": (np.diag(vehicle.M) - [*[vehicle.mass] * 3, *np.diag(np.reshape(vehicle.tensor, (3, 3)))]).tolist(),
        "linear_damping": np.abs(vehicle.damping).tolist(),
        "quadratic_damping": np.abs(vehicle.quadratic_damping).tolist(),
        "thrusters": [
            {
                # The point of a line nearest to the origin: r = d x m, of the direction d and the moment m of one newton.
                "position": (np.cross(column[:3], column[3:]) + 0.0).tolist(),
                "direction": column[:3].tolist(),
                **most,
                "curve": "quadratic",
            }
            for column in along.T
        ],
        "uncertainty": {"added_mass": 0.1, "linear_damping": 0.3, "quadratic_damping": 0.3, "inertia": 0.05},
        "source": "cola2_core, dynamics.py",
    }  # fmt: skip


def disagreement(vehicle: Any, model: Any, count: int = 400) -> list[float]:
    """Return the difference of the model's forces from the class's, as shares of these (rms), X to N.

    Args:
        vehicle: of the simulator.
        model: of the same vehicle.
        count: states that are drawn: 0.4 m/s, 0.2 rad/s, 0.15 rad, commands of 0.5.
    """
    rng, both = np.random.default_rng(0), []
    each = vehicle.max_thrusters_rpm
    for _ in range(count):
        nu, given = rng.normal(0, [0.4] * 3 + [0.2] * 3), rng.normal(0, 0.5, 5).clip(-MOST, MOST)
        eta = np.array([0.0, 0.0, 5.0, *rng.normal(0, 0.15, 2), rng.uniform(-3, 3)])
        theirs = vehicle.inverse_dynamic(eta, nu, each * given, vehicle.f, np.zeros(6))
        mine = acceleration(model, eta, nu, given, vehicle.ctf * each**2 * given * abs(given))
        both.append(vehicle.M @ np.stack([mine, theirs], axis=1))
    return shares_off(both)
