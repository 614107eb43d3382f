"""Online learning over a run: the track that the paper's figures draw, and weights frozen at each moment."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.errors import ConfigError
from auvnn.logs import Run
from auvnn.models import GreyBox
from auvnn.online import Adapter
from auvnn.online.frozen import frozen_errors
from auvnn.studies.paper.plant import Array

Snapshot = dict[str, Tensor]


@dataclass(frozen=True)
class Change:
    """A known change of the model at a row: from there on the physics are those of `model`."""

    row: int
    model: GreyBox


def snapshot_of(model: GreyBox) -> Snapshot:
    """Return the parameters of a model's damping subnetworks, by name."""
    assert model.damping is not None
    return {name: p.detach().clone() for name, p in model.damping.named_parameters()}


def learners(case: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the ways of learning online that are compared, by name; one that is set to null is left out."""
    return {str(name): how for name, how in (case.get("online") or {}).items() if how is not None}


def adapted(
    model: GreyBox, run: Run, described: Mapping[str, Any], change: Change | None = None
) -> tuple[list[Snapshot], Adapter]:
    """Adapt a model to a run, sample by sample, and return the weights after each sample.

    Args:
        model: trained offline; not changed.
        run: with measured accelerations.
        described: the scheme's options, and `guards`.
        change: a known change of the model's physics during the run.
    """
    options = dict(described)
    if "scheme" not in options:
        raise ConfigError(f"case.online: {described} names no scheme; choose sgd, replay or rls")
    how = {name: options.pop(name) for name in ("guards",) if name in options}
    adapter = Adapter(copy.deepcopy(model).requires_grad_(True), options, watch=False, **how)
    snapshots = []
    assert run.position is not None and run.nu_dot is not None and run.command is not None
    for k in range(run.samples):
        if change is not None and k == change.row:
            adapter.use(change.model)
        eta = np.concatenate([run.position[k], run.quaternion[k]])
        adapter.step(run.t[k], eta, run.nu[k], run.command[k], run.nu_dot[k])
        snapshots.append(adapter.snapshot())
    return snapshots, adapter


def tracked(
    model: GreyBox,
    run: Run,
    snapshots: Sequence[Snapshot] | Snapshot,
    step: float,
    change: Change | None = None,
    jump: Array | None = None,
) -> Array:
    """Return the velocity (T, 6) of the model that runs free while its weights follow every sample.

    The weights of row k, which have seen row k's measurement, act from row k to row k + 1: the state is never
    corrected, the weights are. This is what figures 7 and 8 of the paper draw.

    Args:
        model: the physics before the change.
        run: gives the first state and the commands.
        snapshots: weights after each sample, or one set for all.
        step: longest step of the integrator, s.
        change: a known change of the physics.
        jump: matrix (6, 6) by which the velocity is multiplied at the change, known to both.
    """
    assert run.position is not None and run.command is not None
    now = copy.deepcopy(model).requires_grad_(False)
    later = None if change is None else copy.deepcopy(change.model).requires_grad_(False)
    eta = torch.tensor(np.concatenate([run.position[0], run.quaternion[0]]))
    nu = torch.tensor(run.nu[0])
    times, command = torch.tensor(run.t), torch.tensor(run.command)
    out = [nu[None]]
    cut = None if change is None else change.row
    for first, last in _stretches(snapshots, run.samples, cut):
        if later is not None and first == cut:
            now = later
            nu = nu if jump is None else torch.tensor(jump) @ nu
            out[-1] = torch.cat([out[-1][:-1], nu[None]])
        _load(now, snapshots if isinstance(snapshots, Mapping) else snapshots[first])
        rows = slice(first, last + 1)
        with torch.no_grad():
            run_on = now.rollout(eta, nu, command[rows], times[rows], max_step=step)
        eta, nu = run_on.eta[-1], run_on.nu[-1]
        out.append(run_on.nu[1:])
    return torch.cat(out).numpy()


def _stretches(
    snapshots: Sequence[Snapshot] | Snapshot, samples: int, cut: int | None
) -> list[tuple[int, int]]:
    """Return first and last rows of the stretches over which neither weights nor physics change."""
    starts = {0} if cut is None else {0, cut}
    if not isinstance(snapshots, Mapping):
        pairs = pairwise(snapshots)
        starts |= {k + 1 for k, (a, b) in enumerate(pairs) if any(not torch.equal(a[n], b[n]) for n in a)}
    edges = [*sorted(k for k in starts if k < samples - 1), samples - 1]
    return list(pairwise(edges))


def _load(model: GreyBox, snapshot: Snapshot) -> None:
    assert model.damping is not None
    with torch.no_grad():
        for name, parameter in model.damping.named_parameters():
            parameter.copy_(snapshot[name])


@dataclass(frozen=True)
class Ahead:
    """Free runs ahead with frozen weights.

    Attributes:
        starts: s, (W,).
        rmse: of each window over the plant's range, (W, 6).
        overall: root mean square over all windows, (6,).
        diverged: windows that left what is physical; their error counts as the velocity's own size.
    """

    starts: Array
    rmse: Array
    overall: Array
    diverged: int


def frozen_ahead(
    model: GreyBox,
    run: Run,
    truth: Run,
    snapshots: Sequence[Snapshot] | Snapshot,
    rows: Sequence[int],
    horizon: float,
    spread: Array,
    step: float,
) -> Ahead:
    """Freeze the weights at each of the rows and run the model free from the plant's true state there.

    Args:
        model: the physics.
        run: commands.
        truth: the plant's motion without noise: where windows begin, and what they are compared with.
        snapshots: weights after each sample of the run, or one set for all.
        rows: at which windows begin.
        horizon: s.
        spread: range of the plant's velocity (6,).
        step: longest step of the integrator, s.
    """
    own = snapshots if isinstance(snapshots, Mapping) else [snapshots[k] for k in rows]
    found = frozen_errors(model, run, own, rows, horizon=horizon, truth=truth, max_step=step)
    rmse = found.rmse / spread
    return Ahead(found.starts, rmse, np.sqrt(np.mean(rmse**2, axis=0)), int(found.diverged.sum()))


def window_rows(run: Run, horizon: float, stride: int, first: float = 0.0) -> list[int]:
    """Return the rows at which windows of a horizon begin that fit into a run.

    Args:
        run: that is cut.
        horizon: s.
        stride: rows between the beginnings.
        first: s from the run's start before which no window begins.

    Raises:
        ConfigError: none does.
    """
    last = run.samples - round(horizon / run.dt)
    start = int(np.searchsorted(run.t - run.t[0], first - 1e-9))
    rows = list(range(start, last, max(1, int(stride))))
    if not rows:
        raise ConfigError(
            f"case.ahead={horizon:g} s from {first:g} s on does not fit into {run.duration:g} s: shorten it"
        )
    return rows
