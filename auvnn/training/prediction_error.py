"""Fit effect parameters to a log by the error of free-running windows (multiple shooting).

Each window starts from a state of its own, which is estimated with the parameters, so that measurement noise
enters only where it is: in the outputs. No derivative is taken and nothing is smoothed, which is why neither a
filter nor the hold of the commands can pass for a lag. Windows are reduced to small sums, so that memory
does not grow with the log and runs can be left out without another pass.

Reference: Ljung (1999), System Identification, section 7; Bock (1983) for multiple shooting.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.training.ran import run
from auvnn.training.sensitivity import Response, respond_by

Array = NDArray[np.float64]

# A weak pull on each initial state towards the measured one keeps channels that were not measured in place:
# metres, radians, m/s, rad/s.
LOOSE = np.array([10.0] * 3 + [1.0] * 3 + [2.0] * 3 + [2.0] * 3)
# A channel is never trusted beyond this share of its own motion: the integrator's error and the logging's last
# digits must not pass for information.
TRUST = 1e-4
# Windows worked out at a time, as long as there are no more parameters than columns: this bounds the memory.
CHUNK, COLUMNS = 48, 80
# Numbers of an answer that stay near the processor.
NEAR = 2_500_000
# Windows run free at a time, and their thrusts differentiated.
BLOCK = CHUNK


@dataclass(frozen=True)
class Statistics:
    """Sums of weighted windows after the initial state is projected out, one entry per window.

    Attributes:
        hessian: (B, P, P), J^T J.
        slope: (B, P), J^T e.
        cost: (B,), e^T e.
        channel: (B, 18) sum of squared errors in SI units.
        count: (B, 18) samples.
        rough: (B, 18) sum of squared differences of successive errors: noise without the slow part.
        pairs: (B, 18) differences.
        run: (B,) run numbers.
        first: (B,) index of the first sample.
    """

    hessian: Array
    slope: Array
    cost: Array
    channel: Array
    count: Array
    rough: Array
    pairs: Array
    run: NDArray[np.int64]
    first: NDArray[np.int64]

    @cached_property
    def total(self) -> Array:
        """J^T J of all windows, (P, P)."""
        return self.hessian.sum(0)

    def columns(self, chosen: Sequence[int]) -> Statistics:
        """Return the same statistics for some of the parameters."""
        index = np.asarray(chosen, dtype=int)
        return replace(self, hessian=self.hessian[:, index[:, None], index], slope=self.slope[:, index])

    def noise(self) -> Array:
        """Return each channel's white noise, (18,), from successive differences of the errors; NaN unmeasured."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(self.rough.sum(0) / (2 * self.pairs.sum(0)))


@dataclass(frozen=True)
class Priors:
    """Independent normal priors of the P free parameters: `mean` and `precision` (zero where free), (P,).

    Attributes:
        mean: (P,).
        precision: (P,).
        reach: (P,) no parameter may leave its mean by more; infinite where there is no such limit.
    """

    mean: Array
    precision: Array
    reach: Array | None = None

    def inside(self, theta: Array) -> NDArray[np.bool_]:
        """Return which parameters are within their reach rather than at its end, (P,)."""
        if self.reach is None:
            return np.ones(len(theta), dtype=bool)
        return np.abs(theta - self.mean) < self.reach * (1.0 - 1e-6)


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

    def covariance(self) -> Array:
        """Return the covariance (P, P) of the parameters under white noise of `sigma`."""
        precision = self.statistics.total + np.diag(self.priors.precision)
        # In units of each parameter's own: what is hardly known must not pass for rounding beside what is well known.
        unit = 1.0 / np.sqrt(np.maximum(np.diag(precision), 1e-300))
        return np.linalg.pinv(precision * unit[:, None] * unit, hermitian=True) * unit[:, None] * unit


def parameters_of(model: GreyBox, names: Sequence[str]) -> Array:
    """Return the values of the named effects' parameters, joined, (P,)."""
    parts = [model.effect(n).theta.detach().cpu().numpy() for n in names]
    return np.concatenate(parts) if parts else np.zeros(0)


def set_parameters(model: GreyBox, names: Sequence[str], theta: Array) -> None:
    """Set the values of the named effects' parameters, clipped to their bounds."""
    at = 0
    with torch.no_grad():
        for name in names:
            effect = model.effect(name)
            size = len(effect.parameters_of)
            low = [p.low for p in effect.parameters_of]
            high = [p.high for p in effect.parameters_of]
            effect.theta.copy_(torch.as_tensor(np.clip(theta[at : at + size], low, high)))
            at += size


def limits(model: GreyBox, names: Sequence[str], priors: Priors) -> tuple[Array, Array]:
    """Return least and largest values of the named effects' parameters, (P,) each: their bounds, within reach."""
    described = [p for name in names for p in model.effect(name).parameters_of]
    low = np.array([p.low for p in described], dtype=float)
    high = np.array([p.high for p in described], dtype=float)
    if priors.reach is not None:
        low, high = np.maximum(low, priors.mean - priors.reach), np.minimum(high, priors.mean + priors.reach)
    return low, high


def bounded_step(normal: Array, gradient: Array, low: Array, high: Array) -> Array:
    """Return the step that minimises x^T N x / 2 - g^T x between `low` and `high`, all (P,) but N (P, P).

    Parameters that would leave their range are put at its end, and the others solved for again.
    """
    fixed = np.zeros(len(gradient), dtype=bool)
    step = np.zeros(len(gradient))
    for _ in range(len(gradient) + 1):
        free = ~fixed
        rest = gradient[free] - normal[np.ix_(free, fixed)] @ step[fixed]
        step[free] = np.linalg.lstsq(normal[np.ix_(free, free)], rest, rcond=1e-13)[0]
        out = free & ((step < low) | (step > high))
        step = np.clip(step, low, high)
        if not out.any():
            break
        fixed |= out
    return step


def motion(windows: Windows) -> Array:
    """Return the standard deviation of each channel over the windows, (18,); zero where not measured."""
    # Twice a quaternion's vector part moves like the rotation vector where the turn is small.
    euler_free = torch.cat(
        [
            windows.eta[..., :3],
            2 * windows.eta[..., 4:7],
            windows.nu,
            torch.zeros_like(windows.nu) if windows.nu_dot is None else windows.nu_dot,
        ],
        -1,
    )
    seen = windows.mask
    count = torch.clamp(seen.sum((0, 1)), min=1)
    mean = (euler_free * seen).sum((0, 1)) / count
    return torch.sqrt((((euler_free - mean) * seen) ** 2).sum((0, 1)) / count).numpy()


def answers(model: GreyBox, windows: Windows, initial: Tensor, names: Sequence[str]) -> Iterator[Response]:
    """Yield the windows' answers chunk by chunk."""
    model = model.without_absent(names)
    columns = sum(len(model.effect(n).parameters_of) for n in names)
    size = max(CHUNK * COLUMNS // max(columns, COLUMNS), 1)
    for start in range(0, len(windows), BLOCK):
        block = slice(start, start + BLOCK)
        some, states = windows.pick(block), initial[block]
        ran = run(model, some, states, names)
        few = max(NEAR // (some.nu.shape[1] * 18 * (12 + columns)), 1)
        for begin in range(0, len(some), size):
            part = slice(begin, begin + size)
            yield from respond_by(few, model, some.pick(part), states[part], names, ran=ran.pick(part))


def reduce(windows: Windows, responses: Iterable[Response], sigma: Array) -> tuple[Statistics, Array, Array]:
    """Return the statistics of windows, and how their best initial states follow the parameters.

    Args:
        windows: B windows.
        responses: their answers, in chunks.
        sigma: (18,), infinite where a channel does not count.

    Returns:
        statistics; a (B, 12); A (B, 12, P): the best change of the initial state is a - A dtheta.
    """
    weight = _weights(sigma)
    loose = torch.diag(torch.as_tensor(1.0 / LOOSE))
    # Channels that were not measured would only be multiplied by nought.
    weighed = torch.nonzero(weight).flatten().tolist()
    parts: list[list[Array]] = []
    begin, hessian = 0, np.zeros((len(windows), 0, 0))
    for answer in responses:
        count, length, told, size = answer.parameters.shape
        # Nor does a channel count that nobody measured, whatever noise it would have had.
        live = [k for k in weighed if k < told]
        here = slice(begin, begin + count)
        mask = windows.mask[here] * (weight > 0)
        begin += count
        # The largest of all arrays: made once, and not joined from pieces.
        if hessian.shape[-1] != size:
            hessian = np.empty((len(windows), size, size))
        both = answer.error.new_empty(count, length, len(live), 1 + size)
        both[..., 0] = answer.error[..., live]
        both[..., 1:] = answer.parameters[:, :, live]
        both = both.mul_(weight[live, None]).reshape(count, length * len(live), 1 + size)
        state = answer.state[:, :, live].mul_(weight[live, None]).reshape(count, length * len(live), 12)
        q, r = torch.linalg.qr(torch.cat([state, loose.expand(count, 12, 12)], dim=1))
        q = q[:, :-12]
        along = q.mT @ both
        # With the loose rows left out, this difference is the sum of squares after the best initial state.
        sums = (both.mT @ both).sub_(along.mT @ along)
        hessian[here] = sums[:, 1:, 1:].numpy()
        solved = torch.linalg.solve_triangular(r, along, upper=True)
        remaining = answer.left(solved[..., 0])
        remaining = torch.where(mask > 0, remaining, torch.zeros_like(remaining))
        pair = mask[:, 1:] * mask[:, :-1]
        step = (remaining[:, 1:] - remaining[:, :-1]) * pair
        parts.append(
            [
                x.numpy()
                for x in (
                    sums[:, 1:, 0].clone(),
                    sums[:, 0, 0].clone(),
                    (remaining**2).sum(1),
                    mask.sum(1),
                    (step**2).sum(1),
                    pair.sum(1),
                    solved[..., 0],
                    solved[..., 1:],
                )
            ]
        )
    joined = [np.concatenate(p) for p in zip(*parts, strict=True)]
    slope, cost, channel, count, rough, pairs, change, follow = joined
    run, first = windows.run.astype(np.int64), windows.first.astype(np.int64)
    return Statistics(hessian, slope, cost, channel, count, rough, pairs, run, first), change, follow


def _weights(sigma: Array) -> Tensor:
    return torch.as_tensor(np.where(np.isfinite(sigma), 1.0 / sigma, 0.0))


def _cost(responses: Iterable[Response], sigma: Array) -> float:
    weight = _weights(sigma)
    total = sum(float(((r.error * weight) ** 2).sum()) for r in responses)
    return total if np.isfinite(total) else np.inf


def spread(statistics: Statistics, floor: Array, parameters: int) -> Array:
    """Return each channel's root-mean-square error, (18,), for the degrees of freedom spent; infinite unmeasured."""
    count = statistics.count.sum(0)
    spent = (12 * len(statistics.cost) + parameters) * count / max(count.sum(), 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.sqrt(statistics.channel.sum(0) / np.maximum(count - spent, 0.25 * count))
    return np.where(count > 0, np.maximum(value, floor), np.inf)


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
        iterations: at most this many steps.
        progress: told in words after each step.
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
    here = list(answers(model, windows, initial, names))
    if sigma is None:
        measured = windows.mask.sum((0, 1)).numpy() > 0
        sigma = np.where(measured, 100 * floor + 1e-6, np.inf)
        # The errors of the model as given set the first weights, once the initial states fit them.
        for _ in range(2):
            sigma = spread(reduce(windows, here, sigma)[0], floor, 0)
    converged, taken, damping = False, 0, 0.0

    def penalty(at: Array) -> float:
        return float(priors.precision @ (at - priors.mean) ** 2)

    for taken in range(1, iterations + 1):
        statistics, a, slopes = reduce(windows, here, sigma)
        hessian = statistics.total + np.diag(priors.precision)
        gradient = statistics.slope.sum(0) - priors.precision * (theta - priors.mean)
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        normal = hessian / scale[:, None] / scale
        now = _cost(here, sigma) + penalty(theta)
        for _attempt in range(8):
            step = (
                bounded_step(
                    normal + damping * np.eye(len(theta)),
                    gradient / scale,
                    (low - theta) * scale,
                    (high - theta) * scale,
                )
                / scale
            )
            set_parameters(model, names, theta + step)
            reached = parameters_of(model, names)
            change = a - np.einsum("bij,j->bi", slopes, reached - theta)
            trial = moved(initial, torch.as_tensor(change / (1 + damping)))
            there = list(answers(model, windows, trial, names))
            then = _cost(there, sigma) + penalty(reached)
            if then <= now * (1 + 1e-9) + 1e-6:
                break
            damping = max(4 * damping, 1e-2)
        else:
            set_parameters(model, names, theta)
            break
        gain, damping = now - then, damping / 8 if damping > 1e-4 else 0.0
        theta, initial, here = reached, trial, there
        renewed = sigma if fixed else spread(reduce(windows, here, sigma)[0], floor, len(theta))
        usable = np.isfinite(sigma)
        drift = np.max(np.abs(np.log(renewed[usable] / sigma[usable])), initial=0.0)
        if progress is not None:
            progress(f"step {taken}: error {then:.4g}")
        sigma = renewed
        if gain < 0.05 + 1e-6 * now and drift < 0.02:
            converged = True
            break
    statistics, a, _ = reduce(windows, here, sigma)
    initial = moved(initial, torch.as_tensor(a))
    total = float(statistics.cost.sum()) + penalty(theta)
    return Fitted(model, names, theta, initial, sigma, statistics, priors, total, converged, taken)
