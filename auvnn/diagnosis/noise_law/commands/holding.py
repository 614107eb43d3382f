"""How a command goes from one sample to the next: held, on a straight line, changed ahead of its sample, or noisy.

A log has the command at its samples alone. A controller that runs faster changes it in between, and a model that holds
the sample's command for the whole interval then lags behind by a part of it: errors that look like those of a lag or a
delay. What moves the vehicle over an interval is the mean of the command, and that is taken as

    (1 - share) u_k + share u_(k+1):

a share of zero holds the command, one half is the straight line, anything between zero and one a command that
changes so much of an interval before its sample. Where the command bends much within an interval, the straight line
falls short: `smooth` is the mean of the cubic through four samples, over the interval that the share moves in the same
way. A fast controller answers the noise of its sensors, too, and a log that takes every twentieth of its commands has
that noise in each sample, but not the next nineteen that outweigh it. Taken as held, it attenuates what the vehicle seems
to answer (errors in variables), as if it were heavier. `averaged` is a mean of more samples about the interval's middle,
with binomial weights. Commands that change later than logged are another matter: that is `actuation_delay`. The log is
asked by the likelihood of free running with everything that is uncertain following.

Reference: Carroll, Ruppert, Stefanski and Crainiceanu (2006), Measurement error in nonlinear models, chapter 4, on
regression calibration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.stats import binom
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
LINEAR = 0.5
# Samples whose mean is tried for commands with noise; more are tried as long as they are worth it.
AVERAGED = (4, 8, 16)
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
    """

    name: str
    share: float
    odds: float
    gain: float
    samples: int = 0

    def applied(self, windows: Windows) -> Windows:
        """Return windows of commands that go so."""
        return between(windows, self.share, smooth=self.name == "smooth", samples=self.samples)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        told = {"between_samples": self.name, "share_of_next": self.share, "log_odds": self.odds}
        return {**told, "samples": self.samples} if self.samples else told


HELD = Holding("held", 0.0, 0.0, 0.0)


def between(windows: Windows, share: float, *, smooth: bool = False, samples: int = 0) -> Windows:
    """Return windows whose commands and fins have the means that they take between samples.

    Args:
        windows: of commands that are held.
        share: of the next sample's command in an interval's mean.
        smooth: along the cubic through four samples instead of the straight line through two.
        samples: in the mean with binomial weights, an even number; zero for the share's own law.
    """
    if share == 0.0 and not smooth:
        return windows
    given = windows.inputs
    weights = cubic_weights(share) if smooth else (1.0 - share, share)
    weights = binomial_weights(samples) if samples else weights
    before, after = len(weights) // 2 - 1, len(weights) // 2

    def mixed(values: Tensor) -> Tensor:
        ends = values[:, :1].expand(-1, before, -1), values[:, -1:].expand(-1, after, -1)
        whole = torch.cat([ends[0], values, ends[1]], dim=1)
        count = values.shape[1]
        return torch.stack([w * whole[:, j : j + count] for j, w in enumerate(weights)]).sum(0)

    fins = None if given.fins is None else mixed(given.fins)
    return replace(windows, inputs=replace(given, command=mixed(given.command), fins=fins))


def binomial_weights(samples: int) -> tuple[float, ...]:
    """Return binomial weights of so many samples, half of them before the middle of an interval, half after it."""
    return tuple(float(w) for w in binom.pmf(np.arange(samples), samples - 1, 0.5))


def cubic_weights(share: float) -> tuple[float, ...]:
    """Return the weights of samples -1, 0, 1, 2 in the mean of the cubic through them, share - 1/2 to share + 1/2.

    A share of one half is the interval itself: -1/24, 13/24, 13/24, -1/24.
    """
    at, out = (-1.0, 0.0, 1.0, 2.0), []
    for j in at:
        basis = Polynomial([1.0])
        for m in at:
            if m != j:
                basis = basis * Polynomial([-m / (j - m), 1.0 / (j - m)])
        whole = basis.integ()
        out.append(float(whole(share + 0.5) - whole(share - 0.5)))
    return tuple(out)


def holding(first: FittedHypothesis, windows: Windows) -> Holding:
    """Ask how commands go from sample to sample.

    The squared error is taken as a parabola of the share, through zero, one half and one.

    Args:
        first: a fit of commands that are held.
        windows: those it was fitted to.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    # An acceleration is measured at an instant: the mean over an interval says nothing of it.
    if windows.nu_dot is not None:
        return HELD
    sums = first.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    plain = cost_at_best(first, windows) / factor
    half, full = (cost_at_best(first, between(windows, share)) / factor for share in (LINEAR, 1.0))
    found = Holding("linear", LINEAR, 0.5 * (plain - half), plain - half)
    ahead = _vertex("ahead", (plain, half, full), plain)
    if ahead is not None and ahead.odds > found.odds + PLAINER:
        found = ahead
    low, half, full = (
        cost_at_best(first, between(windows, share, smooth=True)) / factor for share in (0.0, LINEAR, 1.0)
    )
    smooth = _vertex("smooth", (low, half, full), plain)
    if smooth is not None and smooth.odds > found.odds + PLAINER:
        found = smooth
    for samples in AVERAGED:
        gain = plain - cost_at_best(first, between(windows, LINEAR, samples=samples)) / factor
        if 0.5 * gain <= found.odds + PLAINER:
            break
        found = Holding("averaged", LINEAR, 0.5 * gain, gain, samples)
    return found if found.odds > ODDS else HELD


def _vertex(name: str, costs: tuple[float, float, float], plain: float) -> Holding | None:
    """Return the share at which a parabola through the costs at zero, one half and one is least, None without one."""
    bend = 2.0 * (costs[0] - 2.0 * costs[1] + costs[2])
    if not bend > 0.0:
        return None
    share = float(np.clip(LINEAR - (costs[2] - costs[0]) / (2.0 * bend), 0.0, 1.0))
    # c(s) = c(1/2) + slope (s - 1/2) + bend (s - 1/2)^2, with slope = c(1) - c(0).
    least = costs[1] + (costs[2] - costs[0]) * (share - LINEAR) + bend * (share - LINEAR) ** 2
    spread = min(1.0 / np.sqrt(bend), 1.0)
    odds = 0.5 * (plain - least) + min(float(np.log(np.sqrt(2.0 * np.pi) * spread)), 0.0)
    return Holding(name, share, odds, plain - least)


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
