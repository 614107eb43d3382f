"""Names that predict without being the cause: which of them stay in the fit, and what each adds to the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from auvnn.diagnosis.answers.bounds import at_bound
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.residuals.autocorrelation import excess_variance
from auvnn.diagnosis.selection.predictive_density import gain_by_window
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.estimation.prediction_error import FitError

# Share of the error's excess over the noise floor that names must remove together; and standard errors that each must
# gain in addition to the others.
JOINTLY, EACH = 0.2, 2.0
# Of the fit without a name, which says what that costs: a model that is wrong has no minimum worth waiting for.
STEPS = 6


def kept(asked: Setting, state: State, names: Sequence[str]) -> FittedHypothesis | None:
    """Return the joint fit of those names that improve the prediction, or None where they do not together.

    Each must predict what is left out better by more than two standard errors in addition to the others, in a fit that
    has settled, with no parameter at a bound. One that does not is taken out, the least first, and the others are fitted
    again.

    Args:
        asked: what was asked.
        state: with the names in its fit.
        names: those in question.
    """
    found, chooser = state.current, asked.chooser(state.windows)
    left = [n for n in names if n in found.effects]
    others = [n for n in found.effects if n not in left]
    try:
        if others:
            found = chooser.without(found, asked.base, others)
        while left:
            # In the same weights, or their densities could not be compared.
            sigma = found.fitted.sigma
            sizes = {n: _errors(found, chooser.without(found, asked.base, [n], sigma)) for n in left}
            for n in left:
                if at_bound(asked.layout, found, n):
                    sizes[n] = -np.inf
            worst = min(left, key=lambda n: sizes[n])
            if sizes[worst] > EACH:
                break
            left.remove(worst)
            if left:
                found = chooser.without(found, asked.base, [worst])
    except FitError:
        return None
    if not left or not found.fitted.converged:
        return None
    return found if removed(state.first, found) >= JOINTLY else None


def removed(first: FittedHypothesis, found: FittedHypothesis) -> float:
    """Return the share of the error's excess over the noise floor that a fit removes."""
    before = excess_variance(first, first)
    return 1.0 - excess_variance(found, first) / before if before > 0 else 0.0


def without(
    asked: Setting, state: State, found: FittedHypothesis, name: str, *, as_stated: bool = False
) -> FittedHypothesis:
    """Return a fit again without one of its names, everything else refitted.

    Args:
        asked: what was asked.
        state: of the search.
        found: the fit with all names.
        name: of the effect to do without.
        as_stated: whether a coefficient group that is uncertain anyway stays as it was stated; else it follows the log.
    """
    if name not in asked.base:
        # The search has passed there where the name came last.
        left = {*found.effects} - {name}
        for known in (state.first, *reversed(state.path)):
            if {*known.effects} == left and known.fitted.initial.shape == found.fitted.initial.shape:
                return known
    base = [n for n in asked.base if not (as_stated and n == name)]
    return asked.chooser(state.windows).without(found, base, [name], steps=STEPS)


def _errors(found: FittedHypothesis, other: FittedHypothesis) -> float:
    """Return by how many of its standard errors a fit predicts what is left out better than another one."""
    gain = gain_by_window(found, other)
    spread = float(np.sqrt(len(gain)) * gain.std(ddof=1))
    return float(gain.sum()) / spread if spread > 0 else 0.0
