"""The process plant model of the studies: its manoeuvres, logged, and how far a model runs free from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.errors import AuvnnError, ConfigError
from auvnn.logs import Log, Run
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate
from auvnn.studies.paper.options import Options, word

Array = NDArray[np.float64]
AXES = ("u", "v", "w", "p", "q", "r")
UNITS = ("m_s", "m_s", "m_s", "rad_s", "rad_s", "rad_s")


def load_plant(source: str) -> GreyBox:
    """Return the plant, driven by a wrench as in the paper: the vehicle can be actuated in all degrees of freedom.

    Raises:
        ConfigError: it has no damping that a network could learn.
    """
    plant = load(source, actuation="wrench")
    vehicle = plant.vehicle
    parts = (vehicle.linear_damping, vehicle.quadratic_damping)
    if not vehicle.damping_elements and all(p is None or not np.any(p) for p in parts):
        raise ConfigError(f"model={source}: has no damping, which is what the case studies identify")
    return plant


def manoeuvre_log(
    plant: GreyBox, options: Options, noise: str | Mapping[str, Any] = "none", seed: int = 0
) -> Log:
    """Return the paper's manoeuvre as a log: a constant wrench for a time, then none, from rest.

    Args:
        plant: the truth.
        options: of the study, with the manoeuvre.
        noise: condition: a name or its options.
        seed: of the noise.
    """
    excitation = {"name": "paper", **options.manoeuvre}
    return simulate(
        plant, excitation, noise, None, seed, runs=1, duration=options.duration, rate=options.rate,
        accelerations=True, max_step=options.step,
    ).log  # fmt: skip


def rich_log(
    plant: GreyBox,
    options: Options,
    rich: Mapping[str, Any],
    seed: int,
    noise: str | Mapping[str, Any] = "none",
) -> Log:
    """Return runs of random-phase multisines in all six degrees of freedom.

    Args:
        plant: the truth.
        options: of the study.
        rich: `runs`, `duration` (s), `rate` (1/s) and the options of the multisine.
        seed: of multisine and noise.
        noise: condition: a name or its options.
    """
    excitation = {"name": "multisine", **dict(rich.get("excitation") or {})}
    return simulate(
        plant, excitation, noise, None, seed, runs=int(rich["runs"]), duration=float(rich["duration"]),
        rate=float(rich["rate"]), accelerations=True, max_step=options.step,
    ).log  # fmt: skip


def training_log(plant: GreyBox, options: Options, noise: str | Mapping[str, Any]) -> Log:
    """Return what the networks are trained on offline: the manoeuvre, repeated, and with `data: rich` multisines too.

    Args:
        plant: the truth.
        options: of the study.
        noise: condition: a name or its options.

    Raises:
        ConfigError: `case.offline` asks for something else.
    """
    how = options.case["offline"]
    data = word(how["data"], "case.offline.data", ("manoeuvre", "rich"))
    repeats = how["repeats"]
    if isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1:
        raise ConfigError(f"case.offline.repeats={repeats!r}: a whole number of at least 1 is needed")
    runs = [manoeuvre_log(plant, options, noise, 100 * options.seed + i).runs[0] for i in range(repeats)]
    if data == "rich":
        runs += rich_log(plant, options, how["rich"], options.seed, noise).runs
    return Log.from_runs([replace(run, number=i) for i, run in enumerate(runs)], name="training")


def runs_of(rich: Mapping[str, Any]) -> str:
    """Return how many runs the rich manoeuvre has, in words."""
    return "1 run" if rich["runs"] == 1 else f"{rich['runs']} runs"


def training_words(options: Options) -> str:
    """Return in words what the networks are trained on offline."""
    how, rich = options.case["offline"], options.case["offline"]["rich"]
    times = "once" if how["repeats"] == 1 else f"{how['repeats']} times"
    words = f"ours: trained offline on the manoeuvre, {times}"
    if how["data"] == "rich":
        words += (
            f", and on {runs_of(rich)} of {rich['duration']:g} s of multisines at {rich['rate']:g} samples a second; "
            "on the manoeuvre alone the damping is not identified (see case noise_free)"
        )
    return f"{words}; the paper does not say"


def free_run(model: GreyBox, run: Run, step: float, *, start: int = 0, end: int | None = None) -> Array:
    """Return the velocity (T, 6) of a model that runs free from row `start` on the run's commands alone.

    A run that diverges holds its last sound state, as everywhere.

    Args:
        model: that is run.
        run: with commands, positions and attitudes.
        step: longest step of the integrator, s.
        start: row at which it starts.
        end: row before which it ends; the last one where None.
    """
    rows = slice(start, end)
    command = run.command
    assert command is not None and run.position is not None
    eta0 = torch.tensor(np.concatenate([run.position[start], run.quaternion[start]]))
    with torch.no_grad():
        found = model.rollout(
            eta0,
            torch.tensor(run.nu[start]),
            torch.tensor(command[rows]),
            torch.tensor(run.t[rows]),
            max_step=step,
        )
    return found.nu.numpy()


def free_runs(model: GreyBox, runs: Mapping[str, Run], step: float) -> dict[str, Array]:
    """Return `free_run` of several runs from their start; those with the same times are integrated side by side.

    Args:
        model: that is run.
        runs: by name.
        step: longest step of the integrator, s.
    """
    out: dict[str, Array] = {}
    left = dict(runs)
    while left:
        first = next(iter(left.values()))
        alike = {n: r for n, r in left.items() if np.array_equal(r.t, first.t)}
        starts, commands = [], []
        for run in alike.values():
            assert run.command is not None and run.position is not None
            starts.append(np.concatenate([run.position[0], run.quaternion[0]]))
            commands.append(run.command)
        with torch.no_grad():
            found = model.rollout(
                torch.tensor(np.stack(starts)),
                torch.tensor(np.stack([run.nu[0] for run in alike.values()])),
                torch.tensor(np.stack(commands)),
                torch.tensor(first.t),
                max_step=step,
            )
        out |= dict(zip(alike, found.nu.numpy(), strict=True))
        left = {n: r for n, r in left.items() if n not in alike}
    return {name: out[name] for name in runs}


def over_range(model: Array, plant: Array) -> Array:
    """Return the root mean square of the velocity's error over the range of the plant's velocity, (6,).

    Raises:
        AuvnnError: a degree of freedom of the plant does not move.
    """
    spread = np.ptp(plant, axis=0)
    if not (spread > 1e-9).all():
        still = [AXES[i] for i in np.flatnonzero(spread <= 1e-9)]
        raise AuvnnError(f"the plant does not move in {', '.join(still)}: give a manoeuvre that excites them")
    return np.sqrt(np.mean((model - plant) ** 2, axis=0)) / spread


def by_axis(name: str, values: Array) -> dict[str, float]:
    """Return a metric and its worst degree of freedom by name."""
    out = {f"{name}_{axis}": float(v) for axis, v in zip(AXES, values, strict=True)}
    return {f"{name}_worst": float(np.max(values)), **out}
