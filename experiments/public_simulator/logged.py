"""Logs of a simulator's vehicle, with something changed that the model is not told of: what is common to the vehicles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

STEP, RATE, RUNS, DURATION = 0.01, 20, 3, 60.0
NOISE = {
    "linear": 0.006,
    "angular": 0.003,
    "tilt": 0.003,
    "heading": 0.008,
    "horizontal": 0.05,
    "depth": 0.01,
}
MOTION = ("qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r", "x", "y", "z")
# What changes a vehicle, before it drives or in the middle of a run.
Change = Callable[[Any], None]


class Changed(ABC):
    """A vehicle of a simulator, with what is changed of it.

    Args:
        module: of the simulator.
        change: of the vehicle's numbers, before it drives.
        command: of what is commanded, in the order of the vehicle's inputs.
        sensors: of velocities as they are logged, (6,).
        later: of the vehicle's numbers in the middle of a run.
    """

    # Names of the commands in the log.
    commands: tuple[str, ...] = ()

    def __init__(
        self,
        module: Any,
        change: Change | None = None,
        command: Callable[[np.ndarray], np.ndarray] | None = None,
        sensors: Callable[[np.ndarray], np.ndarray] | None = None,
        later: Change | None = None,
    ) -> None:
        """Keep what is changed: each run has a vehicle of its own."""
        self.module, self.change, self.later = module, change, later
        self.command = command or (lambda given: given)
        self.sensors = sensors or (lambda nu: nu)

    @abstractmethod
    def run(self, seed: int) -> np.ndarray:
        """Return the rows of one run, (samples, 1 + columns)."""

    def write(self, path: Path, seed: int) -> Path:
        """Write a log of all runs."""
        import polars

        runs = [self.run(100 * seed + k) for k in range(RUNS)]
        rows = np.concatenate(runs)
        numbers = np.repeat(np.arange(RUNS), [len(r) for r in runs])
        names = (*MOTION, *self.commands)
        columns = {"run": numbers, "t": rows[:, 0], **{c: rows[:, 1 + k] for k, c in enumerate(names)}}
        polars.DataFrame(columns).write_parquet(path)
        return path


def with_values(**values: Any) -> Change:
    """Return what sets numbers of a vehicle; one that it does not have would hide nothing, and is refused."""

    def change(vehicle: Any) -> None:
        for name, value in values.items():
            if not hasattr(vehicle, name):
                raise SystemExit(f"the simulator's vehicle has no {name}")
            setattr(vehicle, name, value)

    return change


def turned(nu: np.ndarray) -> np.ndarray:
    """Return velocities of a sensor that is turned by three degrees about the vertical, (6,)."""
    cos, sin = np.cos(np.radians(3.0)), np.sin(np.radians(3.0))
    return np.array([cos * nu[0] + sin * nu[1], cos * nu[1] - sin * nu[0], *nu[2:]])


def measured(eta: np.ndarray, nu: np.ndarray, rng: np.random.Generator) -> np.ndarray:
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


def acceleration(
    model: Any, eta: np.ndarray, nu: np.ndarray, command: Any, thrust: Any, fins: Any = ()
) -> np.ndarray:
    """Return the acceleration that a model has in a state, (6,), with the thrust given."""
    import torch

    from auvnn.models import Inputs
    from auvnn.physics.attitude import euler_to_quat, quat_to_matrix

    at, speed, commands, forces, angles, now = (
        torch.tensor(x, dtype=torch.float64) for x in (eta, nu, command, thrust, fins, 0.0)
    )
    turned = quat_to_matrix(euler_to_quat(at[3:]))
    with torch.no_grad():
        return model.nu_dot(at[:3], turned, speed, forces, Inputs(commands, angles), now).numpy()


def shares_off(both: list[np.ndarray]) -> list[float]:
    """Return by how much a model's forces are off, as shares of the vehicle's (rms), of pairs of both, each (6, 2)."""
    mine, theirs = np.stack(both).transpose(2, 0, 1)
    return (np.sqrt(((mine - theirs) ** 2).mean(0)) / np.sqrt((theirs**2).mean(0))).tolist()
