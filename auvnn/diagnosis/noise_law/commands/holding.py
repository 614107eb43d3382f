"""How a command goes from one sample to the next: held, on a straight line, changed ahead of its sample, or noisy.

A log has the command at its samples alone. A controller that runs faster changes it in between, and a model that holds
the sample's command for the whole interval then lags behind by a part of it: errors that look like those of a lag or a
delay. What moves the vehicle over an interval is the mean of the command, and that is taken as

    (1 - share) u_k + share u_(k+1):

a share of zero holds the command, one half is the straight line, anything between zero and one a command that
changes so much of an interval before its sample. Where the command bends much within an interval, the straight line
falls short: `smooth` is the cubic through four samples, over the interval that the share moves in the same way. Curves of
thrust bend, too, and it is the mean thrust that counts (`MeanThrust`); where the integrator takes several steps in an
interval, each has its own mean. Line and cubic go through the commands of the samples or through their thrusts, as the
log is likelier.

A fast controller answers the noise of its sensors, too, and a log that takes every twentieth of its commands has
that noise in each sample, but not the next nineteen that outweigh it. Taken as held, it attenuates what the vehicle seems
to answer (errors in variables), as if it were heavier. `averaged` is a mean of more samples about the interval's middle,
with binomial weights. Commands that change later than logged are another matter: that is `actuation_delay`. The log is
asked by the likelihood of free running with everything that is uncertain following: to first order, about a fit to held
commands; where the errors with other ones are too large for that, about a fit to these (a vehicle that steers by fins is
far off its course within seconds of another fin angle).

Reference: Carroll, Ruppert, Stefanski and Crainiceanu (2006), Measurement error in nonlinear models, chapter 4, on
regression calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import between
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
LINEAR = 0.5
# Shares next to one another that a second parabola goes through.
NEAR = 0.1
# Samples whose mean is tried for commands with noise; more are tried as long as they are worth it.
AVERAGED = (4, 8, 16)
# Where the straight line does as well as a share of its own up to these odds, it is the plainer answer.
PLAINER = float(np.log(10.0))
# A squared error of so many times that of held commands is beyond the first order about a fit to these.
FAR = 2.0
# Steps of a fit to other commands: it begins where that of held ones ended.
ITERATIONS = 6


def holding(first: FittedHypothesis, windows: Windows, layout: Layout | None = None) -> Holding:
    """Ask how commands go from sample to sample.

    A share of its own is where parabolas through the squared errors at several shares are least.

    Args:
        first: a fit of commands that are held.
        windows: those it was fitted to.
        layout: of the model as it is stated, for a fit to other commands where the first order is not enough; without it
            none is made.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    # An acceleration is measured at an instant: the mean over an interval says nothing of it.
    if windows.nu_dot is not None:
        return HELD
    curves = MeanThrust.of(first.fitted.model)
    sums = first.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    sigma, about = first.fitted.sigma, first

    def cost(
        share: float, along: str = "ahead", samples: int = 0, curves: MeanThrust | None = curves
    ) -> float:
        some = between(windows, share, along, samples=samples, curves=curves)
        return cost_at_best(about, some, sigma) / factor

    plain, straight = cost(0.0), cost(LINEAR, "linear")
    if layout is not None and straight > FAR * plain:
        about = _nearer(layout, first, between(windows, LINEAR, "linear", curves=curves))
        straight = cost(LINEAR, "linear")
    found = Holding("linear", LINEAR, 0.5 * (plain - straight), plain - straight, curves=curves)
    for name, through in laws_of(curves):
        of = partial(cost, along=name, curves=through)
        wide = [of(share) for share in (0.0, LINEAR, 1.0)]
        rivals = [(LINEAR, wide[1], 0.0)] if name == "smooth" else []
        for share, least, odds in [*rivals, *_best(of, wide)]:
            if 0.5 * (plain - least) + odds > found.odds + PLAINER:
                found = Holding(name, share, 0.5 * (plain - least) + odds, plain - least, curves=through)
    for samples in AVERAGED:
        gain = plain - cost(LINEAR, samples=samples)
        if 0.5 * gain <= found.odds + PLAINER:
            break
        found = Holding("averaged", LINEAR, 0.5 * gain, gain, samples)
    return through_thrusts(found, plain, cost) if found.odds > ODDS else HELD


def _nearer(layout: Layout, first: FittedHypothesis, windows: Windows) -> FittedHypothesis:
    """Return a fit to other commands; the first one where there is none."""
    try:
        return fitted_to(layout, first, windows, first.fitted.sigma)
    except (FitError, np.linalg.LinAlgError):
        return first


def fitted_to(
    layout: Layout, end: FittedHypothesis, windows: Windows, sigma: Array | None = None
) -> FittedHypothesis:
    """Return an explanation fitted to other commands, from where it was.

    Args:
        layout: of the model as it is stated.
        end: the explanation.
        windows: of the other commands.
        sigma: fixed weights; estimated where absent.

    Raises:
        FitError: the fit has nowhere to begin.
    """
    base = [n for n in end.names if n not in end.effects]
    guess = replace(layout, model=end.fitted.model)
    return fit_hypothesis(
        layout, windows, base, end.effects, start=end.fitted, guess=guess, sigma=sigma, iterations=ITERATIONS
    )


def laws_of(curves: MeanThrust | None) -> list[tuple[str, MeanThrust | None]]:
    """Return the laws that have a share of their own, each with what it takes of the thrusters' curves.

    Args:
        curves: of the thrusters; None for a commanded wrench, whose samples have no thrusts of their own.
    """
    found = [("ahead", curves), ("smooth", curves)]
    return found if curves is None else [*found, ("smooth", curves.of_thrusts())]


def through_thrusts(found: Holding, plain: float, cost: Callable[..., float]) -> Holding:
    """Return how commands go, by a line or cubic through thrusts where the log is likelier so.

    Args:
        found: how they go between the commands of samples.
        plain: cost of what its gain is counted from.
        cost: of a share, `along` a law, with `curves` of the thrust.
    """
    if found.curves is None or found.curves.through_thrusts or found.name not in ("linear", "smooth"):
        return found
    curves = found.curves.of_thrusts()
    more = plain - cost(found.share, along=found.name, curves=curves) - found.gain
    if not more > 0.0:
        return found
    return replace(found, odds=found.odds + 0.5 * more, gain=found.gain + more, curves=curves)


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


def cost_with(
    law: Holding,
    first: FittedHypothesis,
    windows: Windows,
    sigma: Array | None = None,
    layout: Layout | None = None,
) -> float:
    """Return the squared error of `cost_at_best` with commands that go by a law, about a fit to these where need be.

    Args:
        law: how commands go.
        first: a fit of commands that are held.
        windows: those it was fitted to.
        sigma: (18,) weights, by default those of the fit.
        layout: as `holding` takes it.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    some = law.applied(windows)
    found = cost_at_best(first, some, sigma)
    if layout is None or law.name == "held" or found <= FAR * cost_at_best(first, windows, sigma):
        return found
    return cost_at_best(_nearer(layout, first, some), some, first.fitted.sigma if sigma is None else sigma)


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
