"""What nobody can name: on which measured inputs the remaining residual depends, by degree of freedom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.residuals.autocorrelation import excess_variance
from auvnn.diagnosis.residuals.input_forces import AXES, InputForces
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# A degree of freedom and what is measured.
Input = tuple[int, str]
# Share of what is unexplained, below which a dependence is not worth a word; standard errors of its gain, below which
# it may be chance; and the most inputs that are reported.
LEAST, SURE, MOST = 0.02, 2.0, 8
# Inputs told beside the one that gains most, where the log cannot tell them from it: by less than a standard error of
# the difference, or by less than this share of the gain.
BESIDE, CLOSE = 2, 0.05


@dataclass(frozen=True)
class Attribution:
    """On which measured inputs a residual depends.

    Attributes:
        shares: degree of freedom to {input: share of the unexplained error}, the largest first.
        inseparable: degree of freedom to groups of inputs of which each explains as much as the others, and the log
            cannot tell which; the shares of one group are of the same error.
    """

    shares: dict[str, dict[str, float]]
    inseparable: dict[str, list[list[str]]]


def attribute_residual(explanation: FittedHypothesis, windows: Windows) -> Attribution:
    """Return by degree of freedom the share of the unexplained error that each measured input explains.

    Forces that are simple functions of one input each (`InputForces`) are added to free running: of those whose gain
    on what is left out is beyond its own uncertainty, the input and the degree of freedom first that gain most, then
    the next beside it. So of two inputs that go together only the one that says more is told, and smooth residuals in
    position and attitude count, which no derivative would show. Where another input says as much, both are told: a
    rudder that follows the speed cannot be told from it by a log, and must not be passed over for it.

    Args:
        explanation: what was found; what it leaves is looked at.
        windows: those it was fitted to.

    Returns:
        the shares; none where nothing measured explains anything.
    """
    fitted = explanation.fitted
    whole = excess_variance(explanation, explanation)
    if whole <= 0:
        return Attribution({axis: {} for axis in AXES}, {})
    probe = InputForces(fitted.model, windows)
    model = fitted.model
    asked = model.extended_by(probe)
    names = [*explanation.names, str(probe.name)]
    sums, _, _ = normal_equations(windows, linearise(asked, windows, fitted.initial, names), fitted.sigma)
    sums = sums.finite()
    known = len(fitted.theta)
    scale = np.array([p.scale for p in probe.parameters_of])
    fold = folds(windows.run)

    def left(chosen: Sequence[Input]) -> Array:
        columns = [c for i, n in chosen for c in probe.columns(i, n)]
        return _left(sums, [*range(known), *(known + c for c in columns)], explanation, scale, fold)

    return select_inputs(left, [(i, n) for i in range(6) for n in probe.inputs], whole)


def select_inputs(
    left: Callable[[Sequence[Input]], Array], inputs: Sequence[Input], whole: float
) -> Attribution:
    """Return the inputs that explain most, one after the other, each beside those before it.

    Args:
        left: from inputs to each window's error, (B,), with forces that are functions of these.
        inputs: that are asked, each for a degree of freedom.
        whole: the unexplained error of all windows.
    """
    found: dict[str, dict[str, float]] = {axis: {} for axis in AXES}
    groups: list[tuple[str, dict[str, float]]] = []
    chosen: list[Input] = []
    now = left(chosen)
    for _ in range(MOST):
        gains = {}
        for each in inputs:
            if each not in chosen:
                gain = now - left([*chosen, each])
                if gain.sum() >= LEAST * whole and gain.sum() >= SURE * _standard_error(gain):
                    gains[each] = gain
        if not gains:
            break
        (axis, name), gain = max(gains.items(), key=lambda item: float(item[1].sum()))
        shares = {n: float(np.clip(g.sum() / whole, 0.0, 1.0)) for (i, n), g in gains.items() if i == axis}
        alike = [n for (i, n), g in gains.items() if i == axis and n != name and _close(gain, g)]
        alike = sorted(alike, key=lambda n: -shares[n])[:BESIDE]
        found[AXES[axis]][name] = shares[name]
        groups.append((AXES[axis], {n: shares[n] for n in (name, *alike)}))
        chosen.append((axis, name))
        now = now - gain
    inseparable: dict[str, list[list[str]]] = {}
    for label, group in groups:
        # What explains more beside the first of its group has been told for itself.
        first, *others = [n for i, n in enumerate(group) if i == 0 or n not in found[label]]
        if others:
            found[label].update({n: group[n] for n in others})
            inseparable.setdefault(label, []).append([first, *others])
    ordered = {a: dict(sorted(row.items(), key=lambda item: -item[1])) for a, row in found.items()}
    return Attribution(ordered, inseparable)


def _standard_error(gain: Array) -> float:
    return float(np.sqrt(len(gain)) * gain.std(ddof=1))


def _close(best: Array, other: Array) -> bool:
    """Whether one gain by window is not surely larger than another."""
    lacks = best - other
    return float(lacks.sum()) < max(_standard_error(lacks), CLOSE * float(best.sum()))


def _left(
    sums: Statistics, columns: list[int], explanation: FittedHypothesis, scale: Array, fold: NDArray[np.int64]
) -> Array:
    """Return each window's error fitted without its fold, with some of the probe's forces beside what was found."""
    fitted = explanation.fitted
    known = len(fitted.theta)
    own = np.array([c - known for c in columns if c >= known], dtype=int)
    held = fitted.priors.extended_by(scale[own] ** -2.0)
    return left_out(sums.columns(columns), np.concatenate([fitted.theta, np.zeros(len(own))]), held, fold)
