"""Fit effect parameters to a log by the error of free-running windows (multiple shooting).

Each window starts from a state of its own, which is estimated with the parameters, so that measurement noise
enters only where it is: in the outputs. No derivative is taken and nothing is smoothed, which is why neither a
filter nor the hold of the commands can pass for a lag. Windows are reduced to small sums, so that memory
does not grow with the log and runs can be left out without another pass.

Reference: Ljung (1999), System Identification, section 7; Bock (1983) for multiple shooting.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.errors import InputError
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import Priors, limits, parameters_of, set_parameters
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.trajectories.initial_steps import better_of, shorter_steps, window_costs
from auvnn.estimation.window_normal_equations import (
    TRUST,
    cost_of,
    linearise,
    motion,
    normal_equations,
    residual_std,
    weights_of,
)
from auvnn.estimation.window_simulation import runs_by_block
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# What torch raises where a matrix has no inverse.
SINGULAR = torch.linalg.LinAlgError  # pyright: ignore[reportPrivateImportUsage]
# A fit goes on beyond its steps while each takes this share off the squared error, up to so many times as many steps.
FALLING, PATIENCE = 0.01, 5
# A fit has settled where a step lowers the squared error by no more than this, and by this share of it, while the
# logarithms of the weights change by less than this.
LITTLE, TINY, DRIFT = 0.05, 1e-6, 0.02
AS_PROMISED = 0.25
# Share of the squared error that a step promises without bringing any of it, where a fit is stuck.
STUCK = 1e-4


class FitError(InputError):
    """A fit has nowhere to begin: free running leaves what is finite, or the equations cannot be solved there."""


@dataclass(frozen=True)
class Fitted:
    """A model fitted to windows.

    Attributes:
        model: with the fitted values.
        names: effects whose parameters are free, in order of the P columns.
        theta: (P,).
        initial: (B, 13) fitted initial states.
        sigma: (18,) weights' standard deviations; infinite for channels not measured.
        statistics: at the fitted point.
        priors: what was assumed.
        cost: weighted squared error at the fitted point, prior terms included.
        converged: whether the last step was negligible.
        iterations: steps taken.
        stuck: whether it ended where the equations promise much and no share of their step brings any of it.
    """

    model: GreyBox
    names: tuple[str, ...]
    theta: Array
    initial: Tensor
    sigma: Array
    statistics: Statistics
    priors: Priors
    cost: float
    converged: bool
    iterations: int
    stuck: bool = False

    def covariance(self) -> Array:
        """Return the covariance (P, P) of the parameters under white noise of `sigma`."""
        whole = self.statistics.total + self.priors.square
        known = NormalEquations(whole, self.statistics.slope.sum(0))
        covariance = known.covariance()
        # Of what the sums say nothing, no more is known than before.
        dead = np.flatnonzero(known.scaled[1] == 0.0)
        covariance[dead, dead] = 1.0 / np.maximum(self.priors.precision[dead], 1e-30)
        return covariance


def fit(
    model: GreyBox,
    windows: Windows,
    names: Sequence[str],
    priors: Priors,
    *,
    initial: Tensor | None = None,
    sigma: Array | None = None,
    iterations: int = 15,
    progress: Callable[[str], None] | None = None,
) -> Fitted:
    """Fit the named effects' parameters and every window's initial state by damped Gauss-Newton.

    Unless `sigma` is given the weights follow the errors that are left, channel by channel, so that a channel
    that the model cannot explain does not drown the others.

    Args:
        model: holds the named effects; it is not changed.
        windows: what to fit.
        names: effects whose parameters are free.
        priors: of those parameters.
        initial: initial states to start from; the measured ones by default.
        sigma: (18,) fixed weights, by default estimated.
        iterations: at most this many steps, and up to five times as many while each still takes a hundredth off the
            squared error: a fit stopped on its way would be judged by where it happened to be.
        progress: called with the state of the work, in words, after each step.

    Raises:
        FitError: at the values to start from, free running leaves what is finite. A step that does so is not taken.
    """
    model = model.rebuilt(model.copied_effects())
    names, fixed = tuple(names), sigma is not None
    if initial is None:
        initial = initial_states(model, windows)
    floor = TRUST * motion(windows) + 1e-9
    theta = parameters_of(model, names)
    low, high = limits(model, names, priors)
    theta = np.clip(theta, low, high)
    set_parameters(model, names, theta)
    here = _answered(model, windows, initial, names)
    if here is None or not np.isfinite(cost_of(here, np.ones(18))):
        raise FitError(
            f"free running of {model.vehicle.name} leaves what is finite within its windows: choose shorter ones with "
            "window=, and check the signs and sizes of its coefficients"
        )
    if sigma is None:
        measured = windows.mask.sum((0, 1)).numpy() > 0
        sigma = np.where(measured, 100 * floor + 1e-6, np.inf)
        # The errors of the model as given set the first weights, once the initial states fit them.
        for _ in range(2):
            sigma = residual_std(normal_equations(windows, here, sigma)[0], floor, 0)
    converged, stuck, taken, allowed, damping = False, False, 0, iterations, 0.0
    drift = 0.0 if fixed else np.inf
    settled: tuple[Statistics, Array, Array] | None = None

    def penalty(at: Array) -> float:
        return priors.penalty(at)

    before: tuple[Array, Tensor, Array] | None = None

    def back(to: tuple[Array, Tensor, Array]) -> list[Response]:
        set_parameters(model, names, to[0])
        return list(linearise(model, windows, to[1], names))

    while taken < allowed:
        taken += 1
        statistics, a, slopes = normal_equations(windows, here, sigma)
        if not _sound(statistics, a, slopes):
            if before is None:
                raise FitError(
                    f"free running of {model.vehicle.name} is too sensitive to {', '.join(names) or 'its start'} to be "
                    "fitted over these windows: choose shorter ones with window="
                )
            # The step led where slopes are none: back to where they were.
            here = back(before)
            theta, initial, sigma = before
            break
        slope = statistics.slope.sum(0)
        known = NormalEquations.with_priors(statistics.total, slope, priors.square, theta - priors.mean)
        now = cost_of(here, sigma) + penalty(theta)
        step = known.bounded(low - theta, high - theta, damping=damping)
        promised = now - penalty(theta) - float(statistics.cost.sum()) + known.gain(step)
        if promised < LITTLE + TINY * now and drift < DRIFT and damping == 0.0 and windows.law is None:
            # So short a step is taken as the equations have it: what it does need not be worked out again.
            set_parameters(model, names, theta + step)
            short = parameters_of(model, names) - theta
            settled = statistics.after(short), a - np.einsum("bij,j->bi", slopes, short), slopes
            theta, converged, taken = theta + short, True, taken - 1
            break
        for attempt in range(8):
            if attempt:
                step = known.bounded(low - theta, high - theta, damping=damping)
            set_parameters(model, names, theta + step)
            reached = parameters_of(model, names)
            change = a - np.einsum("bij,j->bi", slopes, reached - theta)
            trial = moved(initial, torch.as_tensor(change / (1 + damping)))
            most = now * (1 + 1e-9) + 1e-6
            there = _answered(model, windows, trial, names, sigma, most - penalty(reached))
            if there is None and windows.law is None:
                # A few windows that are far from linear in their initial states must not hold up all others.
                costs = window_costs([r.error for r in here], sigma)
                follows, own = (change - a) / (1 + damping), a / (1 + damping)
                shorter = shorter_steps(model, windows, names, sigma, costs, initial, follows, own)
                if shorter is not None:
                    trial = shorter
                    there = _answered(model, windows, trial, names, sigma, most - penalty(reached))
            then = np.inf if there is None else cost_of(there, sigma) + penalty(reached)
            if there is not None and then <= most:
                break
            damping = max(4 * damping, 1e-2)
        else:
            set_parameters(model, names, theta)
            stuck = promised > STUCK * now
            break
        gain = now - then
        # Where a step did much less than the equations have it, a longer one would do worse.
        if gain > AS_PROMISED * (now - penalty(theta) - float(statistics.cost.sum()) + known.gain(step)):
            damping = damping / 8 if damping > 1e-4 else 0.0
        before = theta, initial, sigma
        theta, initial, here = reached, trial, there
        renewed = (
            sigma if fixed else residual_std(normal_equations(windows, here, sigma)[0], floor, len(theta))
        )
        usable = np.isfinite(sigma)
        drift = np.max(np.abs(np.log(renewed[usable] / sigma[usable])), initial=0.0)
        if progress is not None:
            progress(f"step {taken}: error {then:.4g}")
        sigma = renewed
        if gain < LITTLE + TINY * now and drift < DRIFT:
            converged = True
            break
        if taken == allowed and gain > FALLING * now:
            allowed = min(taken + 1, PATIENCE * iterations)
    statistics, a, slopes = settled or normal_equations(windows, here, sigma)
    if before is not None and not _sound(statistics, a, slopes):
        here = back(before)
        theta, initial, sigma = before
        converged = False
        statistics, a, slopes = normal_equations(windows, here, sigma)
    if not _sound(statistics, a, slopes):
        what = ", ".join(names) or "the initial states"
        raise FitError(f"the fit of {what} has no finite errors: choose shorter windows with window=")
    at = moved(initial, torch.as_tensor(a))
    # A fit that has settled is nearly linear there; in another one the last step may lead away.
    if not converged and windows.law is None:
        costs = window_costs([r.error for r in here], sigma)
        at = better_of(model, windows, names, sigma, costs, initial, at)
    initial = at
    total = float(statistics.cost.sum()) + penalty(theta)
    return Fitted(model, names, theta, initial, sigma, statistics, priors, total, converged, taken, stuck)


def _answered(
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    sigma: Array | None = None,
    most: float = np.inf,
) -> list[Response] | None:
    """Return the windows' answers; None where there are none, or none worth differentiating.

    Args:
        model: at the values in question.
        windows: B windows.
        initial: their initial states, (B, 13).
        names: effects whose parameters are differentiated by.
        sigma: weights of the errors, (18,), with `most`.
        most: weighted squared error beyond which a step is not taken.
    """
    if not bool(torch.isfinite(initial).all()):
        return None
    try:
        runs = runs_by_block(model, windows, initial, names)
        # Beside a stochastic force the error alone does not say what it costs.
        if sigma is not None and windows.law is None:
            weight = weights_of(sigma)
            cost = sum(float(((error * weight) ** 2).sum()) for _, _, error in runs)
            # What is on the line is left to the same sum as that which it is compared with.
            if not cost <= most * (1 + 1e-9) + 1e-6:
                return None
        return list(linearise(model, windows, initial, names, runs))
    except SINGULAR:
        return None


def _sound(statistics: Statistics, a: Array, slopes: Array) -> bool:
    """Whether sums are finite."""
    parts = (statistics.hessian, statistics.slope, statistics.cost, a, slopes)
    return all(bool(np.isfinite(x).all()) for x in parts)
