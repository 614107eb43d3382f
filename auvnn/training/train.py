"""Train the damping subnetworks of a model on a log, offline: one step ahead, and from there on free running."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.answers import Answer, plain
from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.logs import Log
from auvnn.logs.leakage import leakage
from auvnn.metrics.derivative import Derivative, choose_derivative
from auvnn.metrics.one_step import OneStep, one_step, scores
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import carried_over
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.progress import Progress
from auvnn.threads import on_one_thread
from auvnn.training.confounding.confounded_effects import confounded_effects
from auvnn.training.confounding.confounding import Confounding
from auvnn.training.figures import history_of, metrics_of
from auvnn.training.fit_damping import Fit, fit_damping, most_iterations
from auvnn.training.history import Record
from auvnn.training.objectives.base import build_objective
from auvnn.training.problem import DampingProblem
from auvnn.training.targets import targets

Array = NDArray[np.float64]
# Share of a single run that decides when to stop; of several runs it is the last.
STOPPING = 0.2


@dataclass(repr=False)
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
    objective: dict[str, Any] = field(default_factory=lambda: {"objective": "one_step"})
    absorbed: Confounding | None = None
    parts: dict[str, Any] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log",
            "test",
            "objective",
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
            {
                "schema": "auvnn/training/1",
                "model": self.name,
                **{n: getattr(self, n) for n in names},
                "absorbed": None if self.absorbed is None else self.absorbed.to_dict(),
                **({} if self.parts is None else {"parts": self.parts}),
            }
        )


@on_one_thread
def train(
    model: GivenModel,
    log: GivenLog,
    scheme: str | Mapping[str, Any] = "levenberg_marquardt",
    damping: str | Mapping[str, Any] = "mlp",
    *,
    objective: str | Mapping[str, Any] = "one_step",
    test: GivenLog | None = None,
    seed: int = 0,
    derivative: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
    resume: bool | Literal["force"] = False,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Training:
    """Train damping subnetworks in addition to what a model states.

    Subnetworks that the model has already are replaced. A part of the log decides when to stop; the test log
    decides nothing and is only judged on.

    Args:
        model: the model; it is not changed.
        log: what to fit on.
        scheme: name of a training scheme, or its options with `scheme`.
        damping: form of the subnetworks, or options with `form`.
        objective: what the subnetworks shall be right about: `one_step`, or from that fit on free running,
            `rollout` or `rollout_torchdiffeq`; or options with `objective`.
        test: held out; by default the last run of `log`, or the last 30 % of a single one.
        seed: of initial weights.
        derivative: how accelerations are obtained where they were not measured.
        checkpoint: folder of checkpoints, from which `resume` goes on, bit for bit.
        resume: go on from the newest checkpoint; "force" even where data or options have changed.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: called with the state of the work, in words, every few iterations.

    Raises:
        ConfigError: an unknown scheme, form or option.
        InputError: nothing to fit, the same data on both sides, or a log that contradicts itself.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, coefficients="drawn", noise="realistic").log
        trained = auvnn.train(model, log, "levenberg_marquardt", "polynomial")
        trained.metrics, trained.model
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    test = None if test is None else as_log(test, "test")
    goal = build_objective(objective)
    log, test = completed(model, log), None if test is None else completed(model, test)
    if log.unmeasured and goal.name == "one_step":
        raise ConfigError(
            f"{log.name}: {', '.join(log.unmeasured)} not measured, so that there are no accelerations to train on: take "
            "objective=rollout"
        )
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
    bank = DampingBank.from_description(damping, seed)
    most = most_iterations(scheme)

    def told(record: Record) -> None:
        if progress is not None and record.iteration % 10 == 0:
            words = f"iteration {record.iteration}: worst relative error {record.worst:.3g}"
            progress(Progress(words, record.iteration, max(most, record.iteration), rough=True))

    def one_step_fit(how: Derivative, folder: str | Path | None) -> tuple[GreyBox, Fit, Array, int]:
        problem, held, nu, held_samples = _problem(model, fitted, stopping, how)
        own = copy.deepcopy(bank)
        fit = fit_damping(
            own,
            problem,
            scheme=scheme,
            held_out=[held],
            seed=seed,
            callback=told,
            checkpoint_folder=folder,
            resume=resume if folder is not None else False,
        )
        own.requires_grad_(True)
        made = GreyBox(model.vehicle, model.copied_effects(), own, model.actuation)
        return carried_over(made, model), fit, nu, held_samples

    trained, fit, nu, held_samples = one_step_fit(how, checkpoint)
    # Whether the damping adds energy is judged below, with what the log leaves open.
    warnings = [
        *model.vehicle.warnings,
        *log.quality().reservations,
        *assumed(log, model),
        *(w for w in fit.warnings if w not in fit.energy),
    ]
    start, begun = trained, "the one-step fit"
    if goal.estimated_start and how.method == "measured":
        other = choose_derivative(log, {"method": "local_polynomial"})
        candidates = [trained, one_step_fit(other, None)[0]]
        if goal.choose(candidates, stopping):
            start, begun = candidates[1], "a one-step fit on accelerations estimated from the velocities"
    refined = goal.refine(start, fitted, stopping, progress)
    warnings += refined.warnings
    one_step_model, trained = trained, refined.model
    before, after = scores(one_step(model, test, how)), scores(one_step(trained, test, how))
    worse = [n for n in after if after[n]["rmse"] > before[n]["rmse"] * (1 + 1e-9)]
    if worse:
        warnings.append(f"held out, one step ahead, {', '.join(worse)} got worse by the training")
    absorbed = confounded_effects(trained, fitted, how)
    warnings += [] if absorbed is None else absorbed.words()
    metrics = metrics_of(fit, before, after, len(nu), held_samples)
    history, stopped = history_of(fit), fit.stopped_because
    if refined.stopped:
        metrics |= _free_running({"before": model, "one_step": one_step_model, "after": trained}, test)
        history["rollout"] = {
            "train": list(refined.train),
            "held_out": list(refined.held_out),
            "start": begun,
        }
        stopped = f"one step: {stopped}; rollout, from {begun}: {refined.stopped}"
    dt = float(np.median([r.dt for r in log.runs]))
    return Training(
        model.vehicle.name,
        log.name,
        test.name,
        fit.scheme,
        bank.describe(),
        seed,
        metrics,
        history,
        stopped,
        {**how.describe(dt), "held_out": held_words, "stopping": stop_words},
        trained,
        warnings,
        [] if absorbed is None else absorbed.surfaces,
        {"objective": goal.name, **goal.options()},
        absorbed,
    )


def _problem(
    model: GreyBox, fitted: Log, stopping: Log, how: Derivative
) -> tuple[DampingProblem, int, Array, int]:
    """Return the one-step problem, the run number of what decides when to stop, velocities, and its samples."""
    nu, target, run = targets(model, fitted, how)
    nu_stop, target_stop, _ = targets(model, stopping, how)
    held = int(run.max()) + 1
    problem = DampingProblem(
        torch.tensor(np.concatenate([nu, nu_stop])),
        torch.tensor(np.concatenate([target, target_stop])),
        run=torch.tensor(np.concatenate([run, np.full(len(nu_stop), held)])),
    )
    return problem, held, nu, len(nu_stop)


def _free_running(models: Mapping[str, GreyBox], test: Log) -> dict[str, Any]:
    """Return the held-out free-running error over 5 s of several models: see `metrics.rollouts`."""
    scale = scale_of(test)
    found: dict[str, Any] = {}
    for name, model in models.items():
        rolled = roll(model, test, "5", scale)
        found[f"held_out_rollout_5_s_total_{name}"] = None if rolled is None else rolled.total(scale)
    return found


__all__ = ["OneStep", "Training", "targets", "train"]
