"""Train the damping subnetworks of a model on a log, offline, on one-step residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from auvnn.answers import Answer, plain
from auvnn.damping.bank import DampingBank
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.derivatives import LocalPolynomial
from auvnn.logs.overlap import leakage
from auvnn.metrics.one_step import (
    Derivative,
    OneStep,
    accelerations,
    choose_derivative,
    inertia_of,
    integrated,
    one_step,
    scores,
)
from auvnn.models import GreyBox
from auvnn.training.fit_damping import Fit, fit_damping
from auvnn.training.history import Record
from auvnn.training.problem import DampingProblem

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
# Share of a single run that decides when to stop; of several runs it is the last.
STOPPING = 0.2


@dataclass
class Training(Answer):
    """How a training went; `to_dict` is `training.json` of the public contract."""

    kind = "training"
    name: str
    log: str
    test: str
    scheme: dict[str, Any]
    damping: dict[str, Any]
    seed: int
    metrics: dict[str, Any]
    history: dict[str, Any]
    stopped: str
    derivative: dict[str, Any]
    model: GreyBox
    warnings: list[str] = field(default_factory=list)
    surfaces: list[dict[str, Any]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log",
            "test",
            "scheme",
            "damping",
            "seed",
            "derivative",
            "metrics",
            "history",
            "stopped",
            "warnings",
        )
        return plain(
            {"schema": "auvnn/training/1", "model": self.name, **{n: getattr(self, n) for n in names}}
        )


class _Recorder(nn.Module):
    """Stands in the place of the subnetworks, adds nothing, and remembers what they would have been given."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: Tensor | None = None

    def forward(self, nu_r: Tensor) -> Tensor:
        self.seen = nu_r.detach().clone()
        return torch.zeros_like(nu_r)


def targets(model: GreyBox, log: Log, derivative: Derivative) -> tuple[Array, Array, Array]:
    """Return what the subnetworks should give: velocities, damping wrench and run numbers, over all samples.

    d(nu) = D(nu) nu = M (nu_dot of the model without it - nu_dot measured): equation 14 of Van de Ven, Flanagan
    and Toal (2004). Where accelerations are estimated, velocity and wrench have passed the same filter.

    Returns:
        nu (N, 6) through the water; target (N, 6), NaN where a sample is missing; run (N,).
    """
    recorder = _Recorder()
    bare = GreyBox(model.vehicle, model.copied_effects(), cast(DampingBank, recorder), model.actuation)
    velocities, wrenches, numbers = [], [], []
    for run in log.runs:
        measured, predicted = accelerations(bare, run, derivative)
        assert recorder.seen is not None
        nu = recorder.seen.numpy()
        nu = np.where(run.valid[:, None], nu, np.nan)
        if derivative.method != "measured":
            # The slope of its integral: what the same filter makes of a force that is linear in the velocity.
            nu = LocalPolynomial(run.t, derivative.half_width, derivative.order)(integrated(run.t, nu))[1]
        velocities.append(nu)
        wrenches.append((predicted - measured) @ inertia_of(bare, run).T)
        numbers.append(np.full(run.samples, run.number))
    return np.concatenate(velocities), np.concatenate(wrenches), np.concatenate(numbers)


def train(
    model: GreyBox,
    log: Log,
    scheme: str | Mapping[str, Any] = "levenberg_marquardt",
    damping: str | Mapping[str, Any] = "mlp",
    *,
    test: Log | None = None,
    seed: int = 0,
    derivative: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
    resume: bool | Literal["force"] = False,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Training:
    """Train damping subnetworks beside what a model states.

    Subnetworks that the model has already are replaced. A part of the log decides when to stop; the test log
    decides nothing and is only judged on.

    Args:
        model: the model; it is not changed.
        log: what to fit on.
        scheme: name of a training scheme, or its options with `scheme`.
        damping: form of the subnetworks, or options with `form`.
        test: held out; by default the last run of `log`, or the last 30 % of a single one.
        seed: of initial weights.
        derivative: how accelerations are obtained where they were not measured.
        checkpoint: folder of checkpoints, from which `resume` goes on, bit for bit.
        resume: go on from the newest checkpoint; "force" even where data or options have changed.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: told in words every few iterations.

    Raises:
        ConfigError: an unknown scheme, form or option.
        InputError: nothing to fit, the same data on both sides, or a log that contradicts itself.
    """
    if test is None:
        log, test, held_words = log.split()
    else:
        leakage(log, test)
        test.quality().refuse_contradictions(force)
        held_words = f"{test.name} is held out"
    log.quality().refuse_contradictions(force)
    how = choose_derivative(log, derivative)
    # What decides when to stop is a part of the log itself: the test log is for judging alone.
    fitted, stopping, stop_words = log.split(STOPPING)
    nu, target, run = targets(model, fitted, how)
    nu_stop, target_stop, _ = targets(model, stopping, how)
    held = int(run.max()) + 1
    problem = DampingProblem(
        torch.tensor(np.concatenate([nu, nu_stop])),
        torch.tensor(np.concatenate([target, target_stop])),
        run=torch.tensor(np.concatenate([run, np.full(len(nu_stop), held)])),
    )
    bank = DampingBank.from_description(damping, seed)

    def told(record: Record) -> None:
        if progress is not None and record.iteration % 10 == 0:
            progress(f"iteration {record.iteration}: worst relative error {record.worst:.3g}")

    fit = fit_damping(
        bank,
        problem,
        scheme=scheme,
        held_out=[held],
        seed=seed,
        callback=told,
        checkpoint_folder=checkpoint,
        resume=resume,
    )
    bank.requires_grad_(True)
    trained = GreyBox(model.vehicle, model.copied_effects(), bank, model.actuation)
    before, after = scores(one_step(model, test, how)), scores(one_step(trained, test, how))
    warnings = [*model.vehicle.warnings, *log.quality().reservations, *fit.warnings]
    worse = [n for n in after if after[n]["rmse"] > before[n]["rmse"] * (1 + 1e-9)]
    if worse:
        warnings.append(f"held out, one step ahead, {', '.join(worse)} got worse by the training")
    dt = float(np.median([r.dt for r in log.runs]))
    return Training(
        model.vehicle.name,
        log.name,
        test.name,
        fit.scheme,
        bank.describe(),
        seed,
        _metrics(fit, before, after, len(nu), len(nu_stop)),
        _history(fit),
        fit.stopped_because,
        {**how.describe(dt), "held_out": held_words, "stopping": stop_words},
        trained,
        warnings,
        _curves(trained, nu),
    )


def _metrics(fit: Fit, before: dict, after: dict, samples: int, held: int) -> dict[str, Any]:
    units = ("N", "N", "N", "N_m", "N_m", "N_m")
    found: dict[str, Any] = {
        "samples_fitted": samples,
        "samples_for_stopping": held,
        "iterations": fit.iterations,
        "seconds": fit.seconds,
    }
    for k, (axis, unit) in enumerate(zip(AXES, units, strict=True)):
        found[f"rmse_{axis}_{unit}"] = fit.rmse[k]
        found[f"relative_rmse_{axis}"] = fit.relative_rmse[k]
        if fit.held_out_rmse is not None:
            found[f"stopping_rmse_{axis}_{unit}"] = fit.held_out_rmse[k]
    for name in after:
        found[f"held_out_r2_{name}_before"] = before[name]["r2"]
        found[f"held_out_r2_{name}_after"] = after[name]["r2"]
    return found


def _history(fit: Fit) -> dict[str, Any]:
    """Return the root mean square over the learned degrees of freedom, one number an iteration."""

    def joined(rows: list) -> list[float]:
        return [float(np.sqrt(np.nanmean(np.square(row)))) for row in rows]

    data = fit.history.to_dict()
    return {
        "iteration": data["iteration"],
        "train": joined(data["train"]),
        "held_out": joined(data["held_out"]),
        "by_axis": data,
        "step": "iteration",
        "error": "error over the target's spread (1)",
    }


def _curves(model: GreyBox, nu: Array) -> list[dict[str, Any]]:
    """Return what the subnetworks make of each velocity alone, over half as much again as the log covered."""
    out = []
    assert model.damping is not None
    for k in range(6):
        column = nu[np.isfinite(nu[:, k]), k]
        if not len(column):
            raise InputError(f"velocity {'uvwpqr'[k]} has no usable sample")
        low, high = float(column.min()), float(column.max())
        reach = 1.5 * max(abs(low), abs(high), 1e-6)
        grid = np.linspace(-reach, reach, 121)
        states = np.zeros((len(grid), 6))
        states[:, k] = grid
        with torch.no_grad():
            force = model.damping(torch.tensor(states)).numpy()[:, k]
        out.append({"nu": grid, "learned": force, "low": low, "high": high})
    return out


__all__ = ["OneStep", "Training", "targets", "train"]
