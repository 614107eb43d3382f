"""How a command goes from one sample to the next: held, on a straight line, changed ahead of its sample, or noisy.

A log has the command at its samples alone. A controller that runs faster changes it in between, and a model that holds
the sample's command for the whole interval then lags behind by a part of it: errors that look like those of a lag or a
delay. What moves the vehicle over an interval is the mean of the command, and that is taken as

    (1 - share) u_k + share u_(k+1):

a share of zero holds the command, one half is the straight line, anything between zero and one a command that
changes so much of an interval before its sample. Where the command bends much within an interval, the straight line
falls short: `smooth` is the cubic through four samples, over the interval that the share moves in the same way. Curves of
thrust bend, too, and it is the mean thrust that counts (`MeanThrust`); where the integrator takes several steps in an
interval, each has its own mean.

A fast controller answers the noise of its sensors, too, and a log that takes every twentieth of its commands has
that noise in each sample, but not the next nineteen that outweigh it. Taken as held, it attenuates what the vehicle seems
to answer (errors in variables), as if it were heavier. `averaged` is a mean of more samples about the interval's middle,
with binomial weights. Commands that change later than logged are another matter: that is `actuation_delay`. The log is
asked by the likelihood of free running with everything that is uncertain following.

Reference: Carroll, Ruppert, Stefanski and Crainiceanu (2006), Measurement error in nonlinear models, chapter 4, on
regression calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import binom
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.commands.mean_thrust import MeanThrust
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.windows import Windows
from auvnn.models.free_running.rollout import steps_per_interval

Array = NDArray[np.float64]
LINEAR = 0.5
# Shares next to one another that a second parabola goes through.
NEAR = 0.1
# Places within an interval and their weights: exact up to the seventh power of the time.
PLACES, WEIGHTS = (
    x / 2.0 + shift for x, shift in zip(np.polynomial.legendre.leggauss(4), (0.5, 0.0), strict=True)
)
# Samples whose mean is tried for commands with noise; more are tried as long as they are worth it.
AVERAGED = (4, 8, 16)
# Moments as weights of neighbouring samples, and the weights of the moments; and what gives them of part of an interval.
Moments = tuple[Sequence[tuple[float, ...]], tuple[float, ...]]
Law = Callable[[float, tuple[float, float]], Moments]
# Where the straight line does as well as a share of its own up to these odds, it is the plainer answer.
PLAINER = float(np.log(10.0))


@dataclass(frozen=True)
class Holding:
    """How commands go from sample to sample, by a log.

    Attributes:
        name: "held", "linear", "ahead", "smooth" or "averaged".
        share: of the next sample's command in an interval's mean.
        odds: logarithm of the odds against holding; zero where it is held.
        gain: fall of the weighted squared error, for the variance that the windows show.
        samples: in an interval's mean, where it is averaged; else zero.
        curves: of the thrusters, whose mean thrust is taken; None for a commanded wrench.
    """

    name: str
    share: float
    odds: float
    gain: float
    samples: int = 0
    curves: MeanThrust | None = None

    def applied(self, windows: Windows) -> Windows:
        """Return windows of commands that go so."""
        smooth = self.name == "smooth"
        return between(windows, self.share, smooth=smooth, samples=self.samples, curves=self.curves)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        told = {"between_samples": self.name, "share_of_next": self.share, "log_odds": self.odds}
        return {**told, "samples": self.samples} if self.samples else told


HELD = Holding("held", 0.0, 0.0, 0.0)


def between(
    windows: Windows,
    share: float,
    *,
    smooth: bool = False,
    samples: int = 0,
    curves: MeanThrust | None = None,
) -> Windows:
    """Return windows whose commands and fins have the means that they take between samples.

    Args:
        windows: of commands that are held.
        share: of the next sample's command in an interval's mean.
        smooth: along the cubic through four samples instead of the straight line through two.
        samples: in the mean with binomial weights, an even number; zero for the share's own law.
        curves: of the thrusters: the command whose thrust is the mean thrust is returned, but for a mean with binomial
            weights, which takes noise out of the commands.
    """
    if share == 0.0 and not smooth:
        return windows
    given = windows.inputs
    if samples:
        weights = binomial_weights(samples)
        fins = None if given.fins is None else _along(given.fins, weights)
        return replace(windows, inputs=replace(given, command=_along(given.command, weights), fins=fins))
    law = cubic_at if smooth else line_at if share == LINEAR else step_at
    parts = steps_per_interval(windows.times, windows.max_step)
    fins = None if given.fins is None else _mean(given.fins, law, share, (0.0, 1.0), None)
    command = _mean(given.command, law, share, (0.0, 1.0), curves)
    within = None
    if parts > 1:
        edges = np.arange(parts + 1) / parts
        within = torch.stack(
            [_mean(given.command, law, share, (a, b), curves) for a, b in pairwise(edges)], dim=-2
        )
    return replace(windows, inputs=replace(given, command=command, fins=fins, within=within))


def _mean(
    values: Tensor, law: Law, share: float, part: tuple[float, float], curves: MeanThrust | None
) -> Tensor:
    """Return what stands for a part of every interval, from begin to end as shares of it."""
    moments, weights = law(share, part)
    paths = [_along(values, moment) for moment in moments]
    if curves is not None:
        return curves.command_for(paths, weights)
    return torch.stack([w * x for w, x in zip(weights, paths, strict=True)]).sum(0)


def _along(values: Tensor, weights: Sequence[float]) -> Tensor:
    """Return sums of neighbouring samples, (B, L, n), half of the weights before the middle of each interval."""
    before, after = len(weights) // 2 - 1, len(weights) // 2
    ends = values[:, :1].expand(-1, before, -1), values[:, -1:].expand(-1, after, -1)
    whole = torch.cat([ends[0], values, ends[1]], dim=1)
    count = values.shape[1]
    return torch.stack([w * whole[:, j : j + count] for j, w in enumerate(weights)]).sum(0)


def binomial_weights(samples: int) -> tuple[float, ...]:
    """Return binomial weights of so many samples, half of them before the middle of an interval, half after it."""
    return tuple(float(w) for w in binom.pmf(np.arange(samples), samples - 1, 0.5))


def cubic_at(share: float, part: tuple[float, float]) -> Moments:
    """Return weights of samples -1, 0, 1, 2 in the cubic through them, at moments of a part of an interval.

    Args:
        share: by how much the interval is moved, less one half.
        part: begin and end, as shares of the interval.
    """
    at = (-1.0, 0.0, 1.0, 2.0)
    times = share - 0.5 + part[0] + (part[1] - part[0]) * PLACES
    weights = [tuple(float(np.prod([(t - m) / (j - m) for m in at if m != j])) for j in at) for t in times]
    return weights, tuple(WEIGHTS)


def line_at(share: float, part: tuple[float, float]) -> Moments:
    """Return the same of samples 0 and 1 on the straight line between them, whatever the share."""
    times = part[0] + (part[1] - part[0]) * PLACES
    return [(1.0 - t, t) for t in times], tuple(WEIGHTS)


def step_at(share: float, part: tuple[float, float]) -> Moments:
    """Return the same of commands that change from sample 0 to sample 1 when that share of the interval is left."""
    after = float(np.clip(part[1] - (1.0 - share), 0.0, part[1] - part[0]) / (part[1] - part[0]))
    return [(1.0, 0.0), (0.0, 1.0)], (1.0 - after, after)


def holding(first: FittedHypothesis, windows: Windows) -> Holding:
    """Ask how commands go from sample to sample.

    A share of its own is where parabolas through the squared errors at several shares are least.

    Args:
        first: a fit of commands that are held.
        windows: those it was fitted to.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    # An acceleration is measured at an instant: the mean over an interval says nothing of it.
    if windows.nu_dot is not None:
        return HELD
    curves = MeanThrust.of(first.fitted.model)
    sums = first.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)

    def cost(share: float, smooth: bool = False, samples: int = 0) -> float:
        some = between(windows, share, smooth=smooth, samples=samples, curves=curves)
        return cost_at_best(first, some) / factor

    plain, half, full = (cost(share) for share in (0.0, LINEAR, 1.0))
    cubic = [cost(share, True) for share in (0.0, LINEAR, 1.0)]
    found = Holding("linear", LINEAR, 0.5 * (plain - half), plain - half, curves=curves)
    rivals = [("smooth", LINEAR, cubic[1], 0.0)]
    rivals += [("ahead", *at) for at in _best(cost, (plain, half, full))]
    rivals += [("smooth", *at) for at in _best(partial(cost, smooth=True), cubic)]
    for name, share, least, odds in rivals:
        if 0.5 * (plain - least) + odds > found.odds + PLAINER:
            found = Holding(name, share, 0.5 * (plain - least) + odds, plain - least, curves=curves)
    for samples in AVERAGED:
        gain = plain - cost(LINEAR, samples=samples)
        if 0.5 * gain <= found.odds + PLAINER:
            break
        found = Holding("averaged", LINEAR, 0.5 * gain, gain, samples)
    return found if found.odds > ODDS else HELD


def _best(cost: Callable[[float], float], wide: Sequence[float]) -> list[tuple[float, float, float]]:
    """Return what `least_share` does, from where a parabola through zero, one half and one is least; none without one."""
    begin = _vertex(wide, LINEAR, 0.5)
    found = None if begin is None else least_share(cost, begin[0])
    return [] if found is None else [found]


def least_share(cost: Callable[[float], float], begin: float) -> tuple[float, float, float] | None:
    """Return the share of least cost, that cost, and the logarithm of the odds that its freedom takes; None without one.

    Args:
        cost: of a share; over all shares no parabola.
        begin: about where it is least.
    """
    middle = float(np.clip(begin, NEAR, 1.0 - NEAR))
    found = _vertex([cost(middle - NEAR), cost(middle), cost(middle + NEAR)], middle, NEAR)
    if found is None:
        return None
    # Its standard error over all that the share could be.
    odds = min(float(np.log(np.sqrt(2.0 * np.pi) * min(found[1], 1.0))), 0.0)
    return found[0], cost(found[0]), odds


def _vertex(costs: Sequence[float], middle: float, step: float) -> tuple[float, float] | None:
    """Return where a parabola through costs at three shares is least, and its standard error; None without one."""
    low, centre, high = costs
    bend = (low - 2.0 * centre + high) / step**2
    if not bend > 0.0:
        return None
    share = middle - (high - low) / (2.0 * step) / bend
    return float(np.clip(share, 0.0, 1.0)), float(np.sqrt(2.0 / bend))


def cost_at_best(first: FittedHypothesis, windows: Windows, sigma: Array | None = None) -> float:
    """Return the squared error with everything that is uncertain following, to first order, its priors in it.

    Args:
        first: a fit.
        windows: perhaps other ones than it was fitted to.
        sigma: (18,) weights, by default those of the fit.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    fitted = first.fitted
    sums, _, _ = normal_equations(
        windows,
        linearise(fitted.model, windows, fitted.initial, first.names),
        fitted.sigma if sigma is None else sigma,
    )
    inside = fitted.priors.inside(fitted.theta)
    if not (np.isfinite(sums.cost).all() and np.isfinite(sums.total[np.ix_(inside, inside)]).all()):
        raise np.linalg.LinAlgError("free running grows without bound")
    pull = (sums.slope.sum(0) - fitted.priors.pull(fitted.theta))[inside]
    square = (sums.total + fitted.priors.square)[np.ix_(inside, inside)]
    step = np.linalg.lstsq(square, pull, rcond=1e-12)[0] if inside.any() else np.zeros(0)
    best = float(sums.cost.sum() - (pull @ step if inside.any() else 0.0))
    return best + (fitted.priors.penalty(fitted.theta) if len(fitted.theta) else 0.0)
