"""A hypothesis at the parameters that its law has moved it to, its windows linear about free running with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.initial_states import fit_initial_states
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# What is raised where free running grows without bound, and sums of it cannot be solved.
UNSOLVED = (FitError, np.linalg.LinAlgError, SINGULAR)


def relinearised(
    best: Hypothesis,
    windows: Windows,
    weights: Array,
    judge: Callable[[FittedHypothesis, ForceLaw], Hypothesis],
) -> Hypothesis:
    """Return a hypothesis at the parameters that its law has moved it to; as it was where that is worse.

    The windows stay linear about the free running without the force, with the initial states that suit it best: a
    force takes an unstable vehicle too far from the free running for a linearisation about its own initial states.

    Args:
        best: the hypothesis.
        windows: those it was fitted to.
        weights: (18,) by which errors count in fits without the force.
        judge: from an explanation and a law to the hypothesis with the law that is most likely with it.
    """
    law, found = best.estimate.law, best.explanation
    assert law is not None
    for share in (1.0, 0.3):
        theta = found.fitted.theta + share * best.estimate.step
        model = found.fitted.model.rebuilt(found.fitted.model.copied_effects())
        set_parameters(model, found.names, theta)
        try:
            initial = fit_initial_states(
                model.without_absent(found.names), windows, weights, found.fitted.initial
            )
            again = judge(_at(found, windows, model, theta, initial), law)
        except UNSOLVED:
            continue
        # Where the windows are far from linear, a whole step leads away.
        if again.evidence > best.evidence - ODDS:
            return again
    return best


def _at(
    found: FittedHypothesis, windows: Windows, model: GreyBox, theta: Array, initial: Tensor
) -> FittedHypothesis:
    """Return an explanation at other values, its sums without a force computed again there."""
    fitted, judged_by = found.fitted, found.judged or found.fitted.priors
    sums, _, _ = normal_equations(windows, linearise(model, windows, initial, found.names), fitted.sigma)
    cost = float(sums.cost.sum()) + fitted.priors.penalty(theta)
    moved = replace(fitted, model=model, theta=theta, initial=initial, statistics=sums, cost=cost)
    return replace(found, fitted=moved, left_out=left_out(sums, theta, judged_by, folds(windows.run)))
