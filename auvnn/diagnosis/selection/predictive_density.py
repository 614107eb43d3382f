"""Whether an effect pays: free running on what was left out must improve by more than its own uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import limits

Array = NDArray[np.float64]
# Quantile at which gains are cut.
UPPER = 0.75


def improves_predictive_density(after: FittedHypothesis, before: FittedHypothesis) -> bool:
    """Whether what was left out is predicted better by more than the gain's own uncertainty."""
    gain = gain_by_window(after, before)
    return float(gain.sum()) > float(np.sqrt(len(gain)) * gain.std(ddof=1))


def surely_positive(gain: Array, least: float) -> bool:
    """Whether the mean of gains is above zero by so many of its standard errors, as it is or with large gains cut.

    They are cut at the upper quartile. Where a few windows gain very much their spread hides what all others gain. No
    gain is smaller than the same gain cut from above, so where the mean of those that are cut is above zero, that of all
    of them is; losses stay as they are.

    Args:
        gain: (B,) of windows that were left out.
        least: standard errors.

    Reference: Lugosi and Mendelson (2019), Foundations of Computational Mathematics 19, 1145-1190 (means of variables
    with heavy tails).
    """
    cut = np.minimum(gain, max(float(np.quantile(gain, UPPER)), 0.0))
    with np.errstate(invalid="ignore"):
        return any(float(g.sum()) > least * float(np.sqrt(len(g)) * g.std(ddof=1)) for g in (gain, cut))


def gain_by_window(after: FittedHypothesis, before: FittedHypothesis) -> Array:
    """Return by how much each window that was left out is predicted better, (B,); not a number where neither can."""
    with np.errstate(invalid="ignore"):
        return cross_validated_log_density(before) - cross_validated_log_density(after)


def cross_validated_log_density(explanation: FittedHypothesis) -> Array:
    """Return how well each window was predicted: minus twice its log predictive density, up to a constant, (B,).

    A fold of runs is left out, its windows predicted one after the other, each from the other folds and from those
    before it: the terms of a fold sum to its joint density. What the others leave open of the parameters is part of
    what they predict, so that one window that alone says something of a parameter is neither held against an effect
    nor taken for it: with a guess put in place of what they leave open, it outweighed the gain in all others.

    References: Geisser and Eddy (1979), JASA 74(365) 153-160 (predictive densities of what is left out); Dawid (1984),
    JRSS A 147(2) 278-292 (one after the other).
    """
    fitted = explanation.fitted
    held, theta = explanation.judged or fitted.priors, fitted.theta
    # What a bound holds stays there, whatever the slope beyond it promises.
    low, high = limits(fitted.model, explanation.names, held)
    inside = np.nonzero(held.inside(theta) & (theta != low) & (theta != high))[0]
    sums = fitted.statistics.columns(inside.tolist())
    fold = folds(sums.run)
    pull = held.pull(theta)[inside]
    out = sums.cost.copy()
    for f in np.unique(fold):
        own = np.nonzero(fold == f)[0]
        known = sums.hessian[fold != f].sum(0) + held.square[np.ix_(inside, inside)]
        step, volume = NormalEquations(known, sums.slope[fold != f].sum(0) - pull).solve_with_determinant()
        for w in own[np.lexsort((sums.first[own], sums.run[own]))]:
            hessian, slope = sums.hessian[w], sums.slope[w]
            out[w] += step @ hessian @ step - 2 * slope @ step
            ahead = slope - hessian @ step
            known = known + hessian
            change, after = NormalEquations(known, ahead).solve_with_determinant()
            out[w] += after - volume - ahead @ change
            step, volume = step + change, after
    return out
