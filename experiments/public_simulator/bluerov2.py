"""Logs from the BlueROV2 Heavy of `bluerov2_dynamics`, with something changed that the model is not told of."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
from logged import DURATION, NOISE, RATE, STEP, Changed, acceleration, measured, shares_off

FILE = "fossen/BlueROV2.py"
# Earlier versions have added mass and damping with the opposite sign, and no lag of the thrusters.
COMMIT = "44817d4173ab5c7a6ac33a68779359d1789841a8"
# Commands beyond this give less thrust by the class's polynomial.
MOST = 0.9
# Ends of settings: forces ahead and across, N, change of depth, m, roll, pitch, change of heading, rad.
SETTINGS = ((-35.0, 35.0), (-35.0, 35.0), (-1.5, 1.5), (-0.3, 0.3), (-0.3, 0.3), (-1.5, 1.5))
# Of the autopilot in heave, roll, pitch, yaw: force or moment per error, per speed, and the most of it.
GAIN, AGAINST = np.array([60.0, 6.0, 6.0, 6.0]), np.array([40.0, 1.5, 1.5, 2.0])
FORCE = np.array([50.0, 4.0, 4.0, 4.0])


def simulator(folder: Path) -> Any:
    """Return the module of the vehicle from a checkout; another version of the vehicle is refused."""
    if not (folder / FILE).exists():
        raise SystemExit(f"{folder}: no {FILE} in it")
    sys.path.insert(0, str((folder / FILE).parent))
    module = importlib.import_module("BlueROV2")
    if not _is_known(module.BlueROV2()):
        raise SystemExit(f"{folder}: another version of the vehicle; git checkout {COMMIT}")
    return module


def _is_known(vehicle: Any) -> bool:
    """Return whether numbers have the signs that this study takes them with, and thrusters lag."""
    signs = vehicle.MA[0, 0] > 0.0 and vehicle.Xu_abs < 0.0 and vehicle.zb < 0.0
    return bool(signs and len(getattr(vehicle, "thruster_lags", ())) == vehicle.n_thrusters)


def thrust(command: Any) -> Any:
    """Return the thrust that the class gives at rest, N, of commands of -1 to 1 (von Benzon et al., 2022, Eq. 18)."""
    return command * (
        8.9 + command**2 * (176.0 + command**2 * (-404.1 + command**2 * (389.9 - 140.3 * command**2)))
    )


def allocation(vehicle: Any) -> np.ndarray:
    """Return forces and moments per newton of each thruster, (6, 8)."""
    lines = [(t["dir"].ravel(), t["r"].ravel()) for t in vehicle.thrusters_r]
    return np.array([[*d, *np.cross(r, d)] for d, r in lines]).T


class Plant(Changed):
    """The vehicle, with what is changed of it; its commands are those of eight thrusters, -1 to 1."""

    commands = tuple(f"thruster_{i + 1}" for i in range(8))

    def vehicle(self) -> Any:
        """Return a new vehicle, as it is when a run begins."""
        made = self.module.BlueROV2()
        if self.change is not None:
            self.change(made)
        return made

    def run(self, seed: int) -> np.ndarray:
        """Return the rows of one run, (samples, 1 + columns).

        A pilot pushes ahead and across; depth, heading, roll and pitch are held, at values that change.
        """
        vehicle, rng = self.vehicle(), np.random.default_rng(seed)
        x = np.zeros(12)
        x[2], x[5] = 5.0, rng.uniform(-3, 3)
        until = rng.uniform(4, 10, 30).cumsum()
        aims = np.column_stack([rng.uniform(*ends, 31) for ends in SETTINGS])
        aims[:, 2] += x[2]
        aims[:, 5] += x[5]
        pushed, shares = np.zeros(2), np.linalg.pinv(allocation(self.module.BlueROV2()))
        table = np.linspace(-MOST, MOST, 721)
        rows, every, steps = [], round(1 / RATE / STEP), round(DURATION / STEP)
        for i in range(steps + 1):
            t = i * STEP
            if self.later is not None and i == steps // 2:
                self.later(vehicle)
            aim = aims[int(np.searchsorted(until, t))]
            # A hand on a joystick takes a fifth of a second.
            pushed += STEP / 0.2 * (aim[:2] - pushed)
            wrench = np.array([*pushed, *_autopilot(x, aim[2:], rng)])
            given = np.interp(shares @ wrench, thrust(table), table)
            if i % every == 0:
                rows.append([t, *measured(x[:6], self.sensors(x[6:]), rng), *given])
            x = x + STEP * vehicle.dynamics(x, self.command(given), STEP)
        return np.array(rows)


def _autopilot(x: np.ndarray, aim: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the force in heave, N, and the moments, N m; it sees states with noise of their own."""
    levels = [NOISE["depth"], NOISE["tilt"], NOISE["tilt"], NOISE["heading"]]
    errors = aim - x[2:6] - levels * rng.standard_normal(4)
    errors[1:] = (errors[1:] + np.pi) % (2 * np.pi) - np.pi
    seen = x[8:12] + [NOISE["linear"], *[NOISE["angular"]] * 3] * rng.standard_normal(4)
    return np.clip(GAIN * errors - AGAINST * seen, -FORCE, FORCE)


def disagreement(vehicle: Any, model: Any, count: int = 400) -> list[float]:
    """Return the difference of the model's forces from the class's, as shares of these (rms), X to N, lags aside.

    Args:
        vehicle: of the simulator.
        model: of the same vehicle; its lag is left out.
        count: states that are drawn: 0.3 m/s, 0.3 rad/s, 0.2 rad, commands of 0.4.
    """
    model = model.rebuilt([e for e in model.copied_effects() if e.name != "thruster_lag"])
    rng, both = np.random.default_rng(0), []
    for _ in range(count):
        nu, given = rng.normal(0, 0.3, 6), rng.normal(0, 0.4, 8).clip(-MOST, MOST)
        eta = np.array([0.0, 0.0, 5.0, *rng.normal(0, 0.2, 2), rng.uniform(-3, 3)])
        # Without what the lag does: the thrust of the class at rest.
        pushed = allocation(vehicle) @ thrust(given)
        still = vehicle.dynamics(np.concatenate([eta, nu]), np.zeros(8), STEP)[6:]
        theirs = still + vehicle.Minv @ pushed
        mine = acceleration(model, eta, nu, given, thrust(given))
        both.append(vehicle.M @ np.stack([mine, theirs], axis=1))
    return shares_off(both)
