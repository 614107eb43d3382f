"""What nobody can name: on which measured inputs the remaining residual depends, by degree of freedom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.residuals.autocorrelation import excess_variance
from auvnn.diagnosis.residuals.input_forces import AXES, InputForces
from auvnn.estimation.window_normal_equations import Statistics, linearise, normal_equations
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Share of what is unexplained, below which a dependence is not worth a word; standard errors of its gain, below which
# it may be chance; and the most inputs that are reported.
LEAST, SURE, MOST = 0.02, 2.0, 8


def attribute_residual(explanation: FittedHypothesis, windows: Windows) -> dict[str, dict[str, float]]:
    """Return by degree of freedom the share of the unexplained error that each measured input explains.

    Forces that are simple functions of one input each (`InputForces`) are added to free running, the input and the
    degree of freedom first that gains most on what is left out, then the next beside it, for as long as the gain is
    beyond its own uncertainty. So of two inputs that go together only the one that says more is told, and smooth
    residuals in position and attitude count, which no derivative would show.

    Args:
        explanation: what was found; what it leaves is looked at.
        windows: those it was fitted to.

    Returns:
        degree of freedom to {input: share}, the largest first; empty where nothing measured explains anything.
    """
    fitted = explanation.fitted
    found: dict[str, dict[str, float]] = {axis: {} for axis in AXES}
    whole = excess_variance(explanation, explanation)
    if whole <= 0:
        return found
    probe = InputForces(fitted.model, windows)
    model = fitted.model
    asked = model.extended_by(probe)
    names = [*explanation.names, str(probe.name)]
    sums, _, _ = normal_equations(windows, linearise(asked, windows, fitted.initial, names), fitted.sigma)
    sums = sums.finite()
    known = len(fitted.theta)
    scale = np.array([p.scale for p in probe.parameters_of])
    chosen = list(range(known))
    fold = folds(windows.run)
    left = _left(sums, chosen, explanation, scale, fold)
    open_ = [(i, n) for i in range(6) for n in probe.inputs]
    for _ in range(MOST):
        gains = {}
        for i, n in open_:
            more = [*chosen, *(known + probe.columns(i, n))]
            gains[i, n] = left - _left(sums, more, explanation, scale, fold)
        (axis, name), gain = max(gains.items(), key=lambda item: float(item[1].sum()))
        total = float(gain.sum())
        if total < LEAST * whole or total < SURE * np.sqrt(len(gain)) * float(gain.std(ddof=1)):
            break
        found[AXES[axis]][name] = float(np.clip(total / whole, 0.0, 1.0))
        chosen += list(known + probe.columns(axis, name))
        left = left - gain
        open_.remove((axis, name))
    return found


def _left(
    sums: Statistics, columns: list[int], explanation: FittedHypothesis, scale: Array, fold: NDArray[np.int64]
) -> Array:
    """Return each window's error fitted without its fold, with some of the probe's forces beside what was found."""
    fitted = explanation.fitted
    known = len(fitted.theta)
    own = np.array([c - known for c in columns if c >= known], dtype=int)
    held = fitted.priors.extended_by(scale[own] ** -2.0)
    return left_out(sums.columns(columns), np.concatenate([fitted.theta, np.zeros(len(own))]), held, fold)
