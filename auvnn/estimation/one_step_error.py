"""Fit effect parameters to a log by the error of the acceleration one step ahead (equation error).

Measured and predicted acceleration pass the same filter, at the measured states; nothing runs free, so nothing
can run away. Disturbances that last (waves off a wall, a current that nobody measured) then cost no more than
themselves, while in free running they add up; noise of the measured states, on the other hand, pulls the
estimates towards zero, which free-running windows do not suffer from (`prediction_error`). The answer is of the
same form as theirs, so that everything that reads it, standard errors included, serves both.

Reference: Klein and Morelli (2006), Aircraft System Identification, section 5.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects.base import HOOKS as ALL_HOOKS
from auvnn.errors import InputError
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.prediction_error import FitError, Fitted
from auvnn.estimation.priors import Priors, parameters_of, set_parameters
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.one_step import LogComparison
from auvnn.metrics.windows import ACCELERATION, CHANNELS
from auvnn.models import GreyBox

Array = NDArray[np.float64]

# Step of the difference quotients, as a share of each parameter's plausible size.
STEP = 1e-4
# A fit has settled when a step gains less than this share of the cost, and the weights keep still within this.
SETTLED, STILL = 1e-4, 0.01


def fit_one_step(
    model: GreyBox,
    log: Log,
    names: Sequence[str],
    priors: Priors,
    how: Derivative,
    *,
    block: float = 5.0,
    sigma: Array | None = None,
    iterations: int = 15,
    progress: Callable[[str], None] | None = None,
) -> Fitted:
    """Fit the named effects' parameters by Levenberg and Marquardt's method on one-step errors.

    minimises sum_k sum_i (a_i(t_k) - a_model,i(t_k))^2 / sigma_i^2 + the priors' penalty

    Unless `sigma` is given the weights follow the errors that are left, channel by channel.

    Args:
        model: holds the named effects; it is not changed.
        log: measurements.
        names: effects whose parameters are free.
        priors: of those parameters.
        how: how accelerations are obtained.
        block: length of the stretches whose sums are kept apart, s: neighbouring errors are correlated, and
            standard errors and runs left out are worked out from these sums.
        sigma: (18,) fixed weights as in `Fitted`, by default estimated.
        iterations: at most this many steps.
        progress: called with the state of the work, in words, after each step.

    Raises:
        InputError: no sample has a state, a command and an acceleration.
    """
    model = model.rebuilt(model.copied_effects())
    names, fixed = tuple(names), sigma is not None
    runs = LogComparison.of(model, log.runs, how)

    def errors(hooks: Collection[str] = ALL_HOOKS) -> Array:
        runs.update(hooks)
        gap = runs.gap()
        return np.where(np.isfinite(gap), gap, 0.0)

    theta = parameters_of(model, names)
    here = errors()
    counted = (here != 0.0).astype(float)
    if not counted.any():
        raise InputError(f"{log.name} has no sample with state, command and acceleration: nothing to fit")
    own = _spread(here, counted) if sigma is None else sigma[ACCELERATION]
    free = [(model.effect(n), p) for n in names for p in model.effect(n).parameters_of]

    def slopes() -> Array:
        """Return the change of the prediction with each parameter, (N, 6, P), about the last errors."""
        out = np.empty((*here.shape, len(theta)))
        for k, (effect, parameter) in enumerate(free):
            moved = 0.0
            # To the other side where a bound is in the way.
            for step in (STEP * parameter.scale, -STEP * parameter.scale):
                trial = theta.copy()
                trial[k] += step
                set_parameters(model, names, trial)
                moved = parameters_of(model, names)[k] - theta[k]
                if moved != 0.0:
                    break
            out[..., k] = (here - errors(effect.hooks())) / moved
            set_parameters(model, names, theta)
            if k + 1 == len(free) or free[k + 1][0] is not effect:
                runs.update(effect.hooks())
        return out

    def penalty(at: Array) -> float:
        return priors.penalty(at)

    blocks, run, first = _blocks(log, block)
    converged, taken, damping = False, 0, 1e-4
    slope = slopes()
    for taken in range(1, iterations + 1):
        weighted = (slope / own[:, None]).reshape(-1, len(theta))
        pull = weighted.T @ (here / own).ravel()
        known = NormalEquations.with_priors(weighted.T @ weighted, pull, priors.square, theta - priors.mean)
        if not np.isfinite(known.square).all():
            raise FitError(f"the accelerations of {model.vehicle.name} do not stay finite one step ahead")
        now = float(((here / own) ** 2).sum()) + penalty(theta)
        for _attempt in range(10):
            step = known.solve(damping=damping, rcond=1e-13)
            set_parameters(model, names, theta + step)
            reached, there = parameters_of(model, names), errors()
            then = float(((there / own) ** 2).sum()) + penalty(reached)
            if np.isfinite(then) and then <= now:
                break
            damping = max(8 * damping, 1e-3)
        else:
            set_parameters(model, names, theta)
            converged = True
            break
        theta, here, damping = reached, there, damping / 8
        slope = slopes()
        renewed = own if fixed else _spread(here, counted)
        drift = float(np.max(np.abs(np.log(renewed / own))))
        own = renewed
        if progress is not None:
            progress(f"step {taken}: error {then:.5g}")
        if now - then < SETTLED * now and drift < STILL:
            converged = True
            break
    weights = np.full(18, np.inf)
    weights[ACCELERATION] = own
    statistics = _statistics(here / own, slope / own[:, None], here, counted, blocks, run, first)
    total = float(statistics.cost.sum()) + penalty(theta)
    none = torch.zeros(len(statistics.run), 0, dtype=torch.float64)
    return Fitted(model, names, theta, none, weights, statistics, priors, total, converged, taken)


def _spread(error: Array, counted: Array) -> Array:
    """Return the root mean square of each acceleration's error, (6,)."""
    value = np.sqrt((error**2).sum(0) / np.maximum(counted.sum(0), 1.0))
    return np.maximum(value, 1e-12)


def _blocks(log: Log, length: float) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return each sample's block, and of each block its run's number and its first sample in the run."""
    index, run, first = [], [], []
    for one in log.runs:
        own = np.floor((one.t - one.t[0]) / length).astype(np.int64)
        _, start, own = np.unique(own, return_index=True, return_inverse=True)
        index.append(own + len(run))
        run += [one.number] * len(start)
        first += list(start)
    return np.concatenate(index), np.array(run, dtype=np.int64), np.array(first, dtype=np.int64)


def _statistics(
    error: Array,
    slope: Array,
    plain: Array,
    counted: Array,
    blocks: NDArray[np.int64],
    run: NDArray[np.int64],
    first: NDArray[np.int64],
) -> Statistics:
    """Return the sums of `Statistics` block by block."""
    edges = np.concatenate([np.flatnonzero(np.diff(blocks, prepend=-1)), [len(blocks)]])
    size, channels = len(run), len(CHANNELS)
    columns = slope.shape[-1]
    hessian, gradient = np.empty((size, columns, columns)), np.empty((size, columns))
    cost, channel, count = np.empty(size), np.zeros((size, channels)), np.zeros((size, channels))
    rough, pairs = np.zeros((size, channels)), np.zeros((size, channels))
    for b in range(size):
        part = slice(edges[b], edges[b + 1])
        e, s = error[part].ravel(), slope[part].reshape(-1, columns)
        hessian[b], gradient[b], cost[b] = s.T @ s, s.T @ e, e @ e
        channel[b, ACCELERATION] = (plain[part] ** 2).sum(0)
        count[b, ACCELERATION] = counted[part].sum(0)
        pair = counted[part][1:] * counted[part][:-1]
        rough[b, ACCELERATION] = ((np.diff(plain[part], axis=0) ** 2) * pair).sum(0)
        pairs[b, ACCELERATION] = pair.sum(0)
    return Statistics(hessian, gradient, cost, channel, count, rough, pairs, run, first)
