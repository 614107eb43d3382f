"""Fit a damping bank to one-step targets, by any scheme; a killed fit resumes to the same last bit."""

from __future__ import annotations

import copy
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.training.checkpoint import Checkpoints
from auvnn.training.history import Callback, History, Record
from auvnn.training.problem import DampingProblem
from auvnn.training.schemes import SCHEMES
from auvnn.training.schemes.base import Scheme, SchemeTask
from auvnn.training.scrutiny import energy_warnings

if TYPE_CHECKING:
    from auvnn.training.distributed.distributed_problem import DistributedProblem


@dataclass(frozen=True)
class Fit:
    """How a fit went; the parameters themselves are in the bank that was given.

    Args:
        history: relative errors by iteration.
        iterations: iterations (or epochs) done.
        stopped_because: in words.
        seconds: wall time of this call.
        rmse: (6,) root-mean-square error on what was fitted, N and N m.
        relative_rmse: (6,) the same divided by the standard deviation of the target.
        held_out_rmse: (6,) on the held-out runs, or None.
        warnings: sentences about what the fit could not decide, and what looks wrong.
        scheme: name and options of the scheme, plain data.
        energy: those of the warnings that say that the damping adds energy.
    """

    history: History
    iterations: int
    stopped_because: str
    seconds: float
    rmse: tuple[float, ...]
    relative_rmse: tuple[float, ...]
    held_out_rmse: tuple[float, ...] | None
    warnings: tuple[str, ...] = ()
    scheme: dict[str, Any] = field(default_factory=dict)
    energy: tuple[str, ...] = ()


def most_iterations(description: str | Mapping[str, Any] | Scheme) -> int:
    """Return how many iterations or epochs a scheme takes at most."""
    options = build_scheme(description).options()
    return int(options.get("max_iterations") or options.get("epochs") or 1)


def build_scheme(description: str | Mapping[str, Any] | Scheme) -> Scheme:
    """Build a scheme from its name or from `{scheme: name, <options>}`.

    Raises:
        ConfigError: an unknown scheme or option, or a value out of range.
    """
    return SCHEMES.build(description, Scheme, "scheme", "levenberg_marquardt")


def fit_damping(
    bank: DampingBank,
    problem: DampingProblem | DistributedProblem,
    *,
    scheme: str | Mapping[str, Any] | Scheme = "levenberg_marquardt",
    held_out: Collection[int] | None = None,
    seed: int = 0,
    warm_start: bool = False,
    callback: Callback | None = None,
    checkpoint_folder: str | Path | None = None,
    checkpoint_every: int = 20,
    resume: bool | Literal["force"] = False,
) -> Fit:
    """Find the parameters with which bank(nu) comes nearest to the target.

    minimises for every degree of freedom i the mean over samples n of w_ni (d_i(nu_n) - target_ni)^2

    The bank is changed only at the end, at once, and not at all if this raises. The answer depends on nothing
    but the arguments: no global random numbers are used.

    Args:
        bank: what is fitted; its scales are set from the data unless `warm_start`.
        problem: the samples, in memory or in pieces of a log.
        scheme: a name of the catalogue, `{scheme: name, <options>}`, or a scheme.
        held_out: run numbers that are never fitted and decide when to stop and which weights to keep.
        seed: of initial weights and mini-batches.
        warm_start: go out from the bank's present weights and scales.
        callback: called with each `Record`; a true answer stops the fit.
        checkpoint_folder: where to keep checkpoints; None: nowhere.
        checkpoint_every: iterations between two checkpoints.
        resume: go on from the newest intact checkpoint, or start if there is none; `force` even if data or
            options have changed.

    Returns:
        How it went.

    Raises:
        ConfigError: an option cannot be used, or a checkpoint belongs to other data or options.
        InputError: there is nothing to fit, or checkpoints would be overwritten.
        ModelError: no checkpoint is intact.
    """
    started = time.perf_counter()
    chosen = build_scheme(scheme)
    if isinstance(checkpoint_every, bool) or not isinstance(checkpoint_every, int) or checkpoint_every < 1:
        raise ConfigError(f"checkpoint_every is {checkpoint_every!r}: give a whole number of at least 1")
    if resume not in (True, False, "force"):
        raise ConfigError(f"resume is {resume!r}: give true, false or force")
    if resume and checkpoint_folder is None:
        raise ConfigError("resume needs the folder of the checkpoints: give checkpoint_folder")
    if not (chosen.sums_suffice or isinstance(problem, DampingProblem)):
        raise ConfigError(f"scheme {chosen.name} needs its samples in memory: take levenberg_marquardt")
    train, held = problem.split(held_out) if held_out else (problem, None)
    learned = [axis for form in bank.groups() if list(form.parameters()) for axis in form.axes]
    for part in (train, held):
        if part is not None:
            part.check_axes(learned)
    working = copy.deepcopy(bank)
    if not warm_start:
        working.scale_to(*train.mean_squares())
    spread = train.spread() / working.output_scale.cpu().double()
    spread = torch.where(spread > 0, spread, 1.0)
    task = SchemeTask(working, train.scaled(working), held and held.scaled(working), spread, seed, warm_start)
    described = {"scheme": chosen.name, **chosen.options()}
    store = None
    if checkpoint_folder is not None:
        identity = {
            "data": problem.fingerprint(),
            "damping": bank.describe(),
            "scheme": described,
            "held_out": sorted(held_out or []),
            "seed": seed,
            "warm_start": warm_start and _fingerprint(bank),
        }
        store = Checkpoints(checkpoint_folder, identity)
        if not resume:
            store.refuse_if_used()
    chosen.begin(task)
    history, notes = History(), []
    if store is not None and resume:
        notes = _take_up(store, chosen, history, force=resume == "force")
    iterations = len(history.records)
    stopped = chosen.finished()
    while stopped is None:
        chosen.step()
        iterations += 1
        record = _record(iterations, chosen)
        history.records.append(record)
        stopped = chosen.finished()
        if store is not None and (stopped is not None or iterations % checkpoint_every == 0):
            _keep(store, chosen, history)
        if callback is not None and callback(record) and stopped is None:
            stopped = "stopped by the caller"
    result = chosen.finish()
    errors, held_errors = chosen.errors()
    unit = spread * working.output_scale.cpu().double()
    bank.load_state_dict(result.state_dict())
    bank.region = train.region()
    energy = tuple(energy_warnings(bank, train)) if isinstance(train, DampingProblem) else ()
    return Fit(
        history=history,
        iterations=iterations,
        stopped_because=stopped,
        seconds=time.perf_counter() - started,
        rmse=tuple((errors * unit).tolist()),
        relative_rmse=tuple(errors.tolist()),
        held_out_rmse=None if held_errors is None else tuple((held_errors * unit).tolist()),
        warnings=(*notes, *chosen.warnings, *energy),
        scheme=described,
        energy=energy,
    )


def _record(iteration: int, scheme: Scheme) -> Record:
    train, held = scheme.errors()
    return Record(iteration, tuple(train.tolist()), None if held is None else tuple(held.tolist()))


def _keep(store: Checkpoints, scheme: Scheme, history: History) -> None:
    tensors, plain = scheme.save()
    store.save(len(history.records), tensors, {"scheme": plain, "history": history.to_dict()})


def _take_up(store: Checkpoints, scheme: Scheme, history: History, *, force: bool) -> list[str]:
    expected = {name: (tuple(t.shape), t.dtype) for name, t in scheme.save()[0].items()}
    found = store.load(expected, force=force)
    if found is None:
        return []
    _, tensors, plain, notes = found
    scheme.load(tensors, plain["scheme"])
    history.records[:] = History.from_dict(plain["history"]).records
    return notes


def _fingerprint(bank: DampingBank) -> str:
    import hashlib

    digest = hashlib.sha256()
    for name, tensor in bank.state_dict().items():
        digest.update(name.encode() + tensor.detach().cpu().numpy().tobytes())
    return digest.hexdigest()
