"""A small vehicle and short logs of it, made without `simulate`: sines as commands, one free run, white noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from auvnn.effects import Sensed
from auvnn.logs import Log, Run
from auvnn.logs.signals.rotation import multiply
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix
from auvnn.testing import plain_vehicle
from auvnn.vehicle import Vehicle

# Position, attitude, velocity, acceleration: m, rad, m/s and rad/s, m/s2 and rad/s2.
NOISE = {"position": 0.02, "attitude": 0.003, "nu": 0.004, "nu_dot": 0.01}
SIZES = np.array([25.0, 25.0, 25.0, 3.0, 3.0, 4.0])


def small_vehicle(uncertainty: float | Mapping[str, float] = 0.1, **changes: Any) -> Vehicle:
    """Return a vehicle of 50 kg with eight thrusters that reach all six degrees of freedom."""
    groups = ("added_mass", "linear_damping", "quadratic_damping", "inertia")
    each = uncertainty if isinstance(uncertainty, Mapping) else dict.fromkeys(groups, uncertainty)
    horizontal = [([x, y, 0.05], [1.0, -np.sign(x * y), 0.0]) for x in (0.3, -0.3) for y in (0.25, -0.25)]
    vertical = [([x, y, -0.05], [0.0, 0.0, 1.0]) for x in (0.25, -0.25) for y in (0.2, -0.2)]
    plain = {
        "name": "small",
        "center_of_gravity": [0.0, 0.0, 0.04],
        "linear_damping": [25.0, 35.0, 40.0, 4.0, 5.0, 5.0],
        "quadratic_damping": [40.0, 60.0, 80.0, 4.0, 5.0, 6.0],
        "thrusters": [
            {"position": p, "direction": d, "max_forward": 40.0, "max_reverse": 40.0}
            for p, d in [*horizontal, *vertical]
        ],
        "uncertainty": dict(each),
    }
    return plain_vehicle(**{**plain, **changes})


def sines(
    t: np.ndarray, columns: int, seed: int, low: float = 0.04, high: float = 0.35, lines: int = 7
) -> np.ndarray:
    """Return random-phase sums of sines of unit standard deviation, (N, columns)."""
    random = np.random.default_rng(seed)
    edges = np.linspace(low, high, lines + 1)
    frequency = edges[:-1] + np.diff(edges) * random.uniform(size=(columns, lines))
    phase = random.uniform(0, 2 * np.pi, size=(columns, lines))
    waves = np.sin(2 * np.pi * frequency * t[:, None, None] + phase)
    return waves.sum(-1) / np.sqrt(lines / 2)


def make_log(
    model: GreyBox,
    *,
    runs: int = 2,
    duration: float = 20.0,
    rate: float = 10.0,
    noise: float = 0.0,
    seed: int = 0,
    size: float = 1.0,
    accelerations: bool = False,
    uneven: float = 0.0,
    command: np.ndarray | None = None,
    first: int = 0,
    max_step: float = 0.05,
    stir: float = 0.05,
) -> Log:
    """Return a log of a model driven by sums of sines.

    Args:
        model: the truth.
        runs: how many.
        duration: of each, s.
        rate: samples per second.
        noise: multiplies `NOISE`.
        seed: of everything.
        size: multiplies the commands.
        accelerations: whether they are logged.
        uneven: share of a step by which stamps are moved.
        command: (N, n) instead of sines, or (runs, N, n).
        first: number of the first run.
        max_step: of the integration, s.
        stir: spread of the first velocities, m/s and rad/s.
    """
    generators = [np.random.default_rng([seed, number]) for number in range(first, first + runs)]
    times, commands, starts = [], [], []
    for number, random in zip(range(first, first + runs), generators, strict=True):
        t = np.arange(round(duration * rate) + 1) / rate
        t[1:-1] += uneven / rate * random.uniform(-0.5, 0.5, len(t) - 2)
        if command is not None:
            held = command if command.ndim == 2 else command[number - first]
        elif model.actuation == "wrench":
            held = size * SIZES * sines(t, 6, 1000 * seed + number)
        else:
            held = np.clip(0.45 * size * sines(t, model.actuators.size, 1000 * seed + number), -0.95, 0.95)
        heading = random.uniform(-np.pi, np.pi)
        times.append(t)
        commands.append(held)
        starts.append(
            [0.0, 0.0, 5.0, np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2), *stir * random.normal(size=6)]
        )
    t, held, start = (torch.tensor(np.stack(x)) for x in (times, commands, starts))
    with torch.no_grad():
        run = model.rollout(start[:, :7], start[:, 7:], held, t, max_step=max_step, engine="firm")
        rate_of = model.nu_dot(
            run.eta[..., :3], quat_to_matrix(run.eta[..., 3:]), run.nu, run.thrust, Inputs(held), t
        )
        seen = model.sense(Sensed(run.eta[..., :3], run.eta[..., 3:], run.nu, rate_of))
    assert not run.diverged and seen.nu_dot is not None
    made = []
    for i, random in enumerate(generators):
        count = t.shape[1]
        turn = noise * NOISE["attitude"] / 2 * random.normal(size=(count, 3))
        small = np.concatenate([np.sqrt(1 - (turn**2).sum(1, keepdims=True)), turn], axis=1)
        made.append(
            Run(
                first + i,
                times[i],
                multiply(seen.quaternion[i].numpy(), small),
                seen.nu[i].numpy() + noise * NOISE["nu"] * random.normal(size=(count, 6)),
                nu_dot=seen.nu_dot[i].numpy() + noise * NOISE["nu_dot"] * random.normal(size=(count, 6))
                if accelerations
                else None,
                position=seen.position[i].numpy()
                + noise * NOISE["position"] * random.normal(size=(count, 3)),
                **{model.actuation: commands[i]},
            )
        )
    return Log.from_runs(made, name=f"made-{seed}")


def thinned(log: Log, step: int) -> Log:
    """Return every so many-th sample of a log: its commands have changed in between."""
    runs = []
    for run in log.runs:
        arrays = {n: getattr(run, n) for n in ("t", "quaternion", "nu", "position", "thrusters")}
        runs.append(replace(run, **{n: x[::step].copy() for n, x in arrays.items()}))
    return Log.from_runs(runs, name=log.name)
