"""Weights frozen at each moment, and the model run free from there: what adaptation has learned of the vehicle.

Following every residual makes the next sample's prediction good by feed-through alone. Freezing the weights at t
and running free for some seconds shows whether they describe the vehicle.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.func import functional_call, vmap

from auvnn.errors import ConfigError
from auvnn.logs import Run
from auvnn.models import GreyBox, Inputs
from auvnn.models.free_running.limits import LIMIT

Array = NDArray[np.float64]
# Windows run side by side at a time, which bounds the memory.
CHUNK = 512


@dataclass(frozen=True)
class FrozenErrors:
    """Free runs with frozen weights.

    Attributes:
        starts: (W,) time at which each window begins, s.
        error: (W, L, 6) measured minus predicted velocity over each window, row 0 at its start.
        rmse: (W, 6) its root mean square over the window, the start left out, m/s and rad/s.
        end: (W, 6) error at the window's end.
        diverged: (W,) whether the run left what is physical; its error is then the measured velocity's own size.
    """

    starts: Array
    error: Array
    rmse: Array
    end: Array
    diverged: NDArray[np.bool_]


def frozen_errors(
    model: GreyBox,
    run: Run,
    snapshots: Mapping[str, Tensor] | Sequence[Mapping[str, Tensor]],
    rows: Sequence[int] | None = None,
    *,
    horizon: float = 5.0,
    truth: Run | None = None,
    max_step: float = 0.05,
) -> FrozenErrors:
    """Run the model free from many rows of a run, each with its own weights.

    Args:
        model: the physics; its subnetworks give the form, the snapshots their weights.
        run: states to begin from, inputs, and the velocities to compare with.
        snapshots: one for each window (`Adapter.snapshot`), or a single one that holds for all.
        rows: rows of `run` at which the windows begin; by default as many rows from the first as there are
            snapshots. Windows that would end after the run are left out: the answer's `starts` tell.
        horizon: s.
        truth: a run with the same times to begin from and to compare with instead, such as one without noise.
        max_step: of the integrator, s.

    Raises:
        ConfigError: numbers of rows and snapshots differ, or no window fits into the run.
    """
    single = isinstance(snapshots, Mapping)
    count = 1 if single else len(snapshots)
    if rows is None:
        rows = range(run.samples if single else count)
    if not single and len(rows) != count:
        raise ConfigError(f"frozen_errors: {count} snapshots for {len(rows)} rows: give one for each")
    reference = run if truth is None else truth
    length = round(horizon / run.dt) + 1
    command = run.command
    assert command is not None
    good = [
        i for i, row in enumerate(rows)
        if row + length <= run.samples and _sound(reference, run, row, length)
    ]  # fmt: skip
    if not good:
        raise ConfigError(f"frozen_errors: no window of {horizon:g} s fits into the run: shorten the horizon")
    starts = np.array([rows[i] for i in good])
    index = starts[:, None] + np.arange(length)
    times = torch.tensor(run.t[index] - run.t[starts][:, None])
    channels = (run.fins, run.voltage, run.altitude)
    parts = [None if c is None else torch.tensor(c[index]) for c in channels]
    inputs = [torch.tensor(command[index]), *parts]
    eta0, nu0 = torch.tensor(reference.eta[starts]), torch.tensor(reference.nu[starts])
    if isinstance(snapshots, Mapping):
        stacked = {k: v.expand(len(good), *v.shape) for k, v in snapshots.items()}
    else:
        stacked = {k: torch.stack([snapshots[i][k] for i in good]) for k in snapshots[0]}
    whole = copy.deepcopy(model)
    predicted = _free(whole, stacked, eta0, nu0, inputs, times, max_step).numpy()
    measured = reference.nu[index]
    wild = ~np.isfinite(predicted) | (np.abs(np.nan_to_num(predicted)) >= LIMIT)
    diverged = np.asarray(wild.any(axis=(1, 2)))
    error = np.where(diverged[:, None, None], measured, measured - predicted)
    rmse = np.sqrt(np.mean(error[:, 1:] ** 2, axis=1))
    return FrozenErrors(run.t[starts], error, rmse, error[:, -1], diverged)


def _sound(reference: Run, run: Run, row: int, length: int) -> bool:
    part = slice(row, row + length)
    return bool(reference.valid[part].all() and run.valid[part].all())


class _Rollout(torch.nn.Module):
    """A rollout as a module's forward, so that the weights can be exchanged by name."""

    def __init__(self, model: GreyBox, max_step: float) -> None:
        super().__init__()
        self.model, self.max_step = model, max_step

    def forward(self, eta0: Tensor, nu0: Tensor, given: list[Tensor | None], times: Tensor) -> Tensor:
        inputs = Inputs(given[0], *given[1:])  # type: ignore[arg-type]
        return self.model.rollout(
            eta0, nu0, inputs, times, max_step=self.max_step, check=False, engine="torch"
        ).nu


def _free(
    model: GreyBox, weights: Mapping[str, Tensor], eta0: Tensor, nu0: Tensor, inputs: list[Tensor | None],
    times: Tensor, max_step: float,
) -> Tensor:  # fmt: skip
    # All windows share one clock: their times since the start differ by rounding, or it is an error.
    first = times[0]
    if float((times - first).abs().max()) > 1e-3 * float(first[-1]):
        raise ConfigError("frozen_errors: the run is not evenly sampled: resample it first")
    rolling = _Rollout(model, max_step)

    def one(some: dict[str, Tensor], eta: Tensor, nu: Tensor, given: list[Tensor | None]) -> Tensor:
        renamed = {f"model.damping.{k}": v for k, v in some.items()}
        return functional_call(rolling, renamed, (eta, nu, given, first))

    axes = [None if x is None else 0 for x in inputs]
    with torch.no_grad():
        return vmap(one, in_dims=(0, 0, 0, axes), chunk_size=CHUNK)(dict(weights), eta0, nu0, inputs)
