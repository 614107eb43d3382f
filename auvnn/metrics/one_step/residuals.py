"""One-step residuals: measured against predicted acceleration at the same, measured, state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Moment
from auvnn.logs import Log, Run
from auvnn.logs.channels import VELOCITY
from auvnn.metrics.derivative import REPEATS, Derivative
from auvnn.metrics.noise import with_more_noise
from auvnn.metrics.one_step.comparison import RunComparison
from auvnn.models import GreyBox

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OneStep:
    """One run's one-step comparison; NaN where a sample is missing.

    Attributes:
        run: number.
        t: (N,), s.
        measured: (N, 6), m/s2 and rad/s2, after the filter.
        model: (N, 6), after the same filter.
        wrench: (N, 6), N and N m: what the model lacks, M (measured - model).
        noise: (6,) what noise as large as the log's would leave between `measured` and a perfect model's.
        wrench_noise: (6,) the same of `wrench`.
    """

    run: int
    t: Array
    measured: Array
    model: Array
    wrench: Array
    noise: Array
    wrench_noise: Array


def one_step(model: GreyBox, log: Log, derivative: Derivative) -> list[OneStep]:
    """Compare accelerations run by run; see `OneStep`.

    Args:
        model: that is compared.
        log: measurements.
        derivative: how accelerations are obtained.
    """
    found = []
    for run in log.runs:
        measured, predicted = accelerations(model, run, derivative)
        gap, to_wrench = measured - predicted, inertia_of(model, run).T
        # The same again with as much noise once more: what changes is what noise does, to data and model alike.
        louder = [accelerations(model, with_more_noise(run, k), derivative) for k in range(REPEATS)]
        floor = np.concatenate([a - b - gap for a, b in louder])
        found.append(
            _of_measured(
                run,
                OneStep(
                    run.number,
                    run.t,
                    measured,
                    predicted,
                    gap @ to_wrench,
                    _rms(floor),
                    _rms(floor @ to_wrench),
                ),
                to_wrench,
            )
        )
    return found


def _of_measured(run: Run, part: OneStep, to_wrench: Array) -> OneStep:
    """Return a comparison without the degrees of freedom whose velocity has no sensor: nothing can be said of them.

    What the others' wrench owes to accelerations that are not known is left out of it.
    """
    blind = [name in run.estimated for name in VELOCITY]
    if not any(blind):
        return part
    gap = np.where(blind, 0.0, part.measured - part.model)
    noise = np.where(blind, np.nan, part.noise)
    return replace(
        part,
        measured=np.where(blind, np.nan, part.measured),
        model=np.where(blind, np.nan, part.model),
        wrench=np.where(blind, np.nan, gap @ to_wrench),
        noise=noise,
        wrench_noise=np.where(blind, np.nan, part.wrench_noise),
    )


def accelerations(model: GreyBox, run: Run, derivative: Derivative) -> tuple[Array, Array]:
    """Return measured and predicted acceleration of a run, after the same filter, (N, 6) each.

    Spikes of single samples count as missing.

    Args:
        model: that is compared.
        run: N samples.
        derivative: how accelerations are obtained.
    """
    comparison = RunComparison(model, run.cleaned, derivative)
    return comparison.measured, comparison.predicted()


def _rms(x: Array) -> Array:
    """Return the root mean square of each column over what is finite, (k,); zero where nothing is."""
    good = np.isfinite(x)
    return np.sqrt((np.where(good, x, 0.0) ** 2).sum(0) / np.maximum(good.sum(0), 1))


def inertia_of(model: GreyBox, run: Run, time: float | None = None) -> Array:
    """Return the model's inertia matrix (6, 6); of a body that varies in time, that at a time or the run's start.

    Args:
        model: whose matrix is asked for.
        run: for its start.
        time: s; the run's start where None.
    """
    moment = None
    if model.time_varying:
        zero3, zero6 = torch.zeros(3, dtype=torch.float64), torch.zeros(6, dtype=torch.float64)
        moment = Moment(
            torch.tensor(float(run.t[0] if time is None else time)),
            zero3,
            torch.eye(3, dtype=torch.float64),
            zero6,
            zero6,
            zero6,
            torch.zeros(model.actuators.size, dtype=torch.float64),
        )
    with torch.no_grad():
        return model.prepare(moment).total.numpy()


def scores(parts: list[OneStep]) -> dict[str, dict[str, float]]:
    """Return `one_step` of the comparison: rmse, noise floor and R2 of each acceleration."""
    names = ("du", "dv", "dw", "dp", "dq", "dr")
    measured, predicted = (np.concatenate([getattr(p, k) for p in parts]) for k in ("measured", "model"))
    weight = np.array([len(p.t) for p in parts], dtype=float)
    floor = np.sqrt(np.average([p.noise**2 for p in parts], axis=0, weights=weight))
    out = {}
    for k, name in enumerate(names):
        good = np.isfinite(measured[:, k]) & np.isfinite(predicted[:, k])
        gap = measured[good, k] - predicted[good, k]
        total = float(np.sum((measured[good, k] - measured[good, k].mean()) ** 2)) if good.any() else 0.0
        out[name] = {
            "rmse": float(np.sqrt(np.mean(gap**2))) if good.any() else np.nan,
            "noise_floor": float(floor[k]),
            "r2": 1.0 - float(np.sum(gap**2)) / total if total > 0 else np.nan,
        }
    return out
