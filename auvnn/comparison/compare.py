"""Model against measurements: one step, free running, and where the error sits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import DerivativeEntry, Failure
from auvnn.answers import PLOTTED, Answer, plain
from auvnn.cards import Card, figure
from auvnn.checks.doubts import doubts
from auvnn.checks.unmeasured import blind
from auvnn.comparison.baseline import compare_with_baseline, standing
from auvnn.comparison.locate import AXES, Regime, failures, locate
from auvnn.comparison.predictions import RunTraces, stitch, write_predictions
from auvnn.errors import ConfigError
from auvnn.logs import Log
from auvnn.metrics.commands.stated import said
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.noise_floor import noise_floor
from auvnn.metrics.one_step import OneStep, one_step, scores
from auvnn.metrics.rollouts import HORIZONS, Rolled, Scale, rollout_table, scale_of
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.models import GreyBox
from auvnn.models.free_running.excursions import region_of, words_of
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.threads import on_one_thread

Array = NDArray[np.float64]
# Noise hardly adds to the error of longer free runs, and two more of them would take as long as the comparison.
FLOOR_SAMPLES = 4000


@dataclass(repr=False)
class Comparison(Answer):
    """How well a model explains a log; `to_dict` is `comparison.json` of the public contract."""

    kind = "comparison"
    model: str
    log: str
    samples: int
    runs: int
    derivative: DerivativeEntry
    one_step: dict[str, dict[str, float]]
    rollout: dict[str, dict[str, Any]]
    residual_wrench: dict[str, dict[str, float]]
    failures: list[Failure]
    warnings: list[str] = field(default_factory=list)
    series: list[RunTraces] = field(default_factory=list)
    regimes: dict[str, Regime] = field(default_factory=dict)
    noise_floor: Array = field(default_factory=lambda: np.zeros(6))
    quality: Any = None
    baseline: dict[str, Any] = field(default_factory=dict)

    def card(self) -> Card:
        """Return the error of free running, and what it is compared with."""
        rows = [
            [
                "whole run" if h == "full" else f"{h} s",
                *(figure(r.get(k)) for k in ("total", "persistence", "noise_floor")),
            ]
            for h, r in self.rollout.items()
        ]
        where = [f"{f['channel']}: {f['where']} ({100 * f['share']:.0f} %)" for f in self.failures[:3]]
        return Card(
            f"Comparison of {self.model} with {self.log}",
            "; ".join(standing(self.rollout, self.baseline)),
            ["The error sits in " + "; ".join(where) + "."] if where else (),
            ("free running", "error", "velocity held", "noise floor"),
            rows,
            PLOTTED,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "model",
            "log",
            "samples",
            "runs",
            "derivative",
            "one_step",
            "rollout",
            "residual_wrench",
            "failures",
            "warnings",
            "baseline",
        )
        return plain({"schema": "auvnn/comparison/1", **{n: getattr(self, n) for n in names}})

    def write(self, folder: str | Path, *, report: bool = True) -> Path:
        """Write the answer, the predictions as a table, and the report."""
        path = super().write(folder, report=report)
        write_predictions(self.series, Path(folder) / "predictions.parquet")
        return path


@on_one_thread
def compare(
    model: GivenModel,
    log: GivenLog,
    *,
    horizons: Sequence[str | float] = HORIZONS,
    derivative: Mapping[str, Any] | None = None,
) -> Comparison:
    """Compare a model with a log.

    Args:
        model: the model.
        log: measurements; nothing is fitted to them here.
        horizons: seconds of free running from measured states, and "full".
        derivative: how accelerations are obtained where they were not measured: `method`, `half_width`, `order`.

    Raises:
        InputError: the log lacks the commands that drive the model.
        ConfigError: a horizon that is no positive number.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, hidden={"ocean_current": {"v_north": 0.2}}, runs=1, duration=8.0).log
        comparison = auvnn.compare(model, log, horizons=["1", "5"])
        comparison.rollout["5"]["total"]  # error of 5 s of free running, in standard deviations of the motion
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    wanted, log = tuple(_horizon(h) for h in horizons), completed(model, log)
    how = choose_derivative(log, derivative)
    parts = one_step(model, log, how)
    scale = scale_of(log)
    rolled_table, rolled = rollout_table(model, log, scale, wanted)
    for horizon, free in rolled.items():
        rolled_table[horizon]["noise_floor"] = floor_of(model, free, log, scale)
    wrench = np.concatenate([p.wrench for p in parts])
    noise = _wrench_noise(parts)
    located = locate(log, parts)
    dt = float(np.median([run.dt for run in log.runs]))
    with np.errstate(invalid="ignore"):
        residual = {
            axis: {
                "rms": float(np.sqrt(_mean(wrench[:, k] ** 2))),
                "mean": _mean(wrench[:, k]),
                "noise_floor": float(noise[k]),
            }
            for k, axis in enumerate(AXES)
        }
    shown = rolled.get("5") or next(iter(rolled.values()), None)
    return Comparison(
        model.vehicle.name,
        log.name,
        log.samples,
        len(log.runs),
        how.describe(dt),
        scores(parts),
        rolled_table,
        residual,
        failures(parts, located, noise),
        _warnings(model, log, rolled),
        [_series(run.number, run.measured.nu, p, shown) for run, p in zip(log.runs, parts, strict=True)],
        located,
        noise,
        None,
        compare_with_baseline(rolled, model.actuation, scale, log, how),
    )


def _mean(x: Array) -> float:
    return float(np.nanmean(x)) if not np.isnan(x).all() else float("nan")


def floor_of(model: GreyBox, rolled: Rolled, log: Log, scale: Scale) -> float:
    """Return the error that a perfect model would show over the same windows; NaN for very long ones.

    Args:
        model: that is compared.
        rolled: its free runs over the windows of one horizon.
        log: measurements, whose noise counts.
        scale: by which errors of different units are added.
    """
    if rolled.windows.times.shape[1] > FLOOR_SAMPLES:
        return float("nan")
    return noise_floor(model, rolled, log, scale, engine="auto")


def _horizon(value: str | float) -> str:
    if value == "full":
        return "full"
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not 0 < number < 1e6:
        raise ConfigError(f"horizon {value!r} must be a number of seconds above zero, or full")
    return f"{number:g}"


def _wrench_noise(parts: list[OneStep]) -> Array:
    """Return what noise would leave in the residual wrench of a perfect model, (6,)."""
    weight = np.array([len(p.t) for p in parts], dtype=float)
    return np.sqrt(np.average([p.wrench_noise**2 for p in parts], axis=0, weights=weight))


def _series(number: int, nu: Array, part: OneStep, rolled: Rolled | None) -> RunTraces:
    """Return a run's traces for plots: windows of free running stitched one after the other."""
    stitched = np.full_like(nu, np.nan)
    if rolled is not None:
        stitched = stitch(rolled, number, nu)
    return {
        "run": number,
        "t": part.t,
        "measured": nu,
        "model": stitched,
        "measured_acc": part.measured,
        "model_acc": part.model,
        "residual": part.wrench,
    }


def _warnings(model: GreyBox, log: Log, rolled: dict[str, Rolled]) -> list[str]:
    found = [*model.vehicle.warnings, *log.quality().reservations, *assumed(log, model), *blind(log)]
    if not model.vehicle.has_damping and model.damping is None:
        found.append("the model has no damping at all: train its subnetworks, or state damping in its file")
    gone = {h: int(r.diverged.sum()) for h, r in rolled.items() if r.diverged.any()}
    if gone:
        found.append("free runs diverged: " + ", ".join(f"{n} of horizon {h} s" for h, n in gone.items()))
    found += _extrapolated(model, rolled)
    found += said(model, float(np.median([run.dt for run in log.runs])))
    found += doubts(model, log)
    if (
        log.runs[0].wrench is not None
        and log.runs[0].thrusters is not None
        and model.actuation == "thrusters"
    ):
        found.append(_commanded_against_thrusters(model, log))
    return found


def _extrapolated(model: GreyBox, rolled: dict[str, Rolled]) -> list[str]:
    """Say where free runs leave the velocities that the damping was trained on."""
    region = region_of(model)
    if region is None or not rolled:
        return []
    import torch

    predicted = np.concatenate([r.predicted.reshape(-1, 6) for r in rolled.values()])
    beyond = region.words(torch.tensor(predicted))
    return [f"free runs go {words_of(beyond)}"] if beyond else []


def _commanded_against_thrusters(model: GreyBox, log: Log) -> str:
    """Return how the logged wrench compares with what the model's thrusters give for the logged commands."""
    import torch

    slopes = []
    for axis in range(6):
        mine, theirs = [], []
        for run in log.runs:
            assert run.thrusters is not None and run.wrench is not None
            with torch.no_grad():
                thrust = model.actuators.static(torch.tensor(np.nan_to_num(run.thrusters)))
                mine.append((thrust @ model.actuators.allocation.mT).numpy()[:, axis])
            theirs.append(np.nan_to_num(run.wrench[:, axis]))
        a, b = np.concatenate(mine), np.concatenate(theirs)
        slopes.append(float(a @ b / (b @ b)) if b @ b > 0 else float("nan"))
    shown = ", ".join(f"{axis} {s:.2f}" for axis, s in zip(AXES, slopes, strict=True) if np.isfinite(s))
    return f"the log has thrusters and a wrench; the thrusters are used; their wrench over the logged one: {shown}"
