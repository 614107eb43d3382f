"""Fit a model by the very figure that it is judged by: free running from measured states, in standard deviations.

minimises over theta    sum over windows b of rho( sum_tk ((nu_k(t) - nu_k(t; theta)) / s_k)^2 ) + w penalty(theta)

with s_k each velocity's standard deviation and rho quadratic up to three standard deviations of a window's own root mean
square and linear beyond, so that a window that has lost its way does not rule. The start of every window is the measured
state, noise and all, as it is when the model is used. Compare `estimation` by multiple shooting, which estimates the
starts: better for naming causes, not better for predicting from what sensors say. Every window's normal equations are
kept, so that folds of windows can be left out without another pass.

Reference: Ljung (1999), System Identification, section 7 (output error); Huber (1964), Ann. Math. Statist. 35(1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Sensed
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import Priors, limits, parameters_of, set_parameters
from auvnn.estimation.window_normal_equations import linearise
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.rollouts import CUT, Scale
from auvnn.metrics.windows import VELOCITY, Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# A window's root-mean-square error, in standard deviations, from which on it counts linearly.
ROBUST = 3.0
# Steps at most, trials of one step, and the relative gain below which a fit has settled.
STEPS, TRIALS, SETTLED = 8, 7, 1e-3
# Neighbouring samples' errors are correlated over about this long, s: so many of them count as one.
CORRELATED = 1.0


@dataclass(frozen=True)
class Task:
    """What is fitted: windows, and what their errors are measured by.

    Attributes:
        windows: B windows.
        scale: of the log that is judged.
    """

    windows: Windows
    scale: Scale

    def weight(self) -> torch.Tensor:
        """Return (B, L, 6): one over the standard deviation where a velocity was measured and is excited, else zero."""
        mask = self.windows.mask[..., VELOCITY].clone()
        mask[:, 0] = 0.0
        std = np.where(self.scale.excited, self.scale.std, np.inf)
        return mask / torch.as_tensor(std)

    def samples(self) -> Array:
        """Return how many errors each window counts, (B,)."""
        return np.maximum((self.weight() > 0).sum((1, 2)).numpy(), 1.0)


@dataclass(frozen=True)
class FreeRunFit:
    """A fit, and every window's normal equations at it.

    Attributes:
        names: effects whose parameters are free, in order of the P columns.
        theta: (P,).
        priors: what was assumed.
        hessian: (B, P, P).
        slope: (B, P).
        cost: (B,), robust squared error of each window.
        weight: of the priors relative to the errors: the variance of one independent error.
        converged: whether the last step was negligible.
    """

    names: tuple[str, ...]
    theta: Array
    priors: Priors
    hessian: Array
    slope: Array
    cost: Array
    weight: float
    converged: bool

    def newton(self, model: GreyBox, keep: NDArray[np.bool_] | slice, priors: Priors | None = None) -> Array:
        """Return the parameters one bounded Gauss-Newton step from here, fitted to some of the windows, (P,).

        Args:
            model: holds the effects: their bounds.
            keep: (B,) windows that are fitted.
            priors: other ones than the fit's.
        """
        priors = priors or self.priors
        return self.step(keep, *limits(model, self.names, priors), priors)

    def step(
        self, keep: NDArray[np.bool_] | slice, low: Array, high: Array, priors: Priors | None = None
    ) -> Array:
        """Return the same within given bounds, (P,).

        Args:
            keep: (B,) windows that are fitted.
            low: lower bounds of the parameters, (P,).
            high: upper bounds, (P,).
            priors: other ones than the fit's.
        """
        priors = priors or self.priors
        hessian = self.hessian[keep].sum(0) + self.weight * priors.square
        slope = self.slope[keep].sum(0) - self.weight * priors.pull(self.theta)
        return np.clip(self.theta + newton_step(hessian, slope, self.theta, low, high, 0.0), low, high)

    def predicted_error(self, theta: Array, chosen: NDArray[np.bool_]) -> float:
        """Return the squared error of some windows at other parameters, to second order about the fit."""
        d = theta - self.theta
        return float(
            (self.cost[chosen] - 2 * self.slope[chosen] @ d).sum() + d @ self.hessian[chosen].sum(0) @ d
        )


def newton_step(hessian: Array, slope: Array, theta: Array, low: Array, high: Array, damping: float) -> Array:
    """Return a damped Gauss-Newton step within bounds, (P,); none where the sums are not finite.

    Args:
        hessian: (P, P).
        slope: (P,).
        theta: parameters from which the step goes, (P,).
        low: lower bounds of the parameters, (P,).
        high: upper bounds, (P,).
        damping: of the step; 0 is a plain Gauss-Newton step.
    """
    if not (np.isfinite(hessian).all() and np.isfinite(slope).all()):
        return np.zeros(len(theta))
    return NormalEquations(hessian, slope).bounded(low - theta, high - theta, damping=damping)


def predicted(model: GreyBox, windows: Windows) -> Array:
    """Return the velocities that sensors would report in free running from measured starts, (B, L, 6)."""
    with torch.no_grad():
        eta, nu = predict(model.without_absent(), windows, initial_states(model, windows), engine="firm")
        return model.sense(Sensed(eta[..., :3], eta[..., 3:], nu)).nu.numpy()


def costs(model: GreyBox, task: Task) -> Array:
    """Return the robust squared error of each window, (B,)."""
    seen = torch.as_tensor(predicted(model, task.windows))
    error = (task.windows.nu - seen) * task.weight()
    error = torch.nan_to_num(error, nan=CUT, posinf=CUT, neginf=-CUT).clamp(-CUT, CUT)
    square, count = (error**2).sum((1, 2)).numpy(), task.samples()
    size = np.sqrt(square / count)
    return np.where(size > ROBUST, count * (2 * ROBUST * size - ROBUST**2), square)


def normal_equations(model: GreyBox, task: Task, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return J^T J, J^T e and e^T e of every window, robust weights in them: (B, P, P), (B, P), (B,).

    Args:
        model: at the values about which it is linearised.
        task: windows, scales and weights.
        names: effects whose parameters are fitted, P parameters in all.
    """
    weight, samples, at = task.weight(), task.samples(), 0
    if not names:
        count = len(task.windows)
        return np.zeros((count, 0, 0)), np.zeros((count, 0)), costs(model, task)
    hessian, slope, cost = [], [], []
    for answer in linearise(model, task.windows, initial_states(model, task.windows), names):
        size = len(answer.error)
        own = weight[at : at + size]
        error = (answer.error[..., VELOCITY] * own).flatten(1)
        jacobian = (answer.parameters[..., VELOCITY, :] * own[..., None]).flatten(1, 2)
        lost = ~(torch.isfinite(error).all(1) & torch.isfinite(jacobian).all(2).all(1))
        error[lost], jacobian[lost] = 0.0, 0.0
        rms = torch.sqrt((error**2).sum(1) / torch.as_tensor(samples[at : at + size]))
        share = torch.clamp(ROBUST / rms.clamp(min=1e-12), max=1.0)
        turned = jacobian.mT * share[:, None, None]
        hessian.append((turned @ jacobian).numpy())
        slope.append((turned @ error[..., None])[..., 0].numpy())
        cost.append((share * (error**2).sum(1)).numpy())
        at += size
    return np.concatenate(hessian), np.concatenate(slope), np.concatenate(cost)


def fit_free_run(
    model: GreyBox,
    task: Task,
    names: Sequence[str],
    priors: Priors,
    *,
    start: Array | None = None,
    keep: NDArray[np.bool_] | None = None,
    steps: int = STEPS,
) -> FreeRunFit:
    """Fit the named effects' parameters by Levenberg and Marquardt's method.

    Args:
        model: holds the effects; it is not changed.
        task: what is fitted.
        names: effects whose parameters are free.
        priors: of those parameters.
        start: (P,) where to begin; the model's own values by default.
        keep: (B,) windows that count; all by default. The normal equations are returned for all.
        steps: at most this many.
    """
    model = model.rebuilt(model.copied_effects())
    names = tuple(names)
    low, high = limits(model, names, priors)
    theta = np.clip(parameters_of(model, names) if start is None else start, low, high)
    set_parameters(model, names, theta)
    keep = np.ones(len(task.windows), dtype=bool) if keep is None else keep
    at = costs(model, task)
    rate = 1.0 / max(float(np.median(np.diff(task.windows.times.numpy(), axis=1))), 1e-3)
    variance = float(at[keep].sum() / task.samples()[keep].sum())
    weight = max(variance, 1e-6) * max(CORRELATED * rate, 1.0)

    def penalty(where: Array) -> float:
        return weight * priors.penalty(where)

    now, damping, converged = float(at[keep].sum()) + penalty(theta), 1e-3, not len(theta)
    hessian, slope, cost = normal_equations(model, task, names)
    for _ in range(steps if len(theta) else 0):
        total = hessian[keep].sum(0) + weight * priors.square
        downhill = slope[keep].sum(0) - weight * priors.pull(theta)
        for _trial in range(TRIALS):
            set_parameters(model, names, theta + newton_step(total, downhill, theta, low, high, damping))
            reached = parameters_of(model, names)
            then = float(costs(model, task)[keep].sum()) + penalty(reached)
            if then < now:
                break
            damping = max(8 * damping, 1e-3)
        else:
            set_parameters(model, names, theta)
            converged = True
            break
        gain, now, theta, damping = now - then, then, reached, damping / 8
        hessian, slope, cost = normal_equations(model, task, names)
        if gain < SETTLED * now:
            converged = True
            break
    return FreeRunFit(names, theta, priors, hessian, slope, cost, weight, converged)
