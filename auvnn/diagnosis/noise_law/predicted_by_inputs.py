"""How much of a force the measured inputs predict: that part is not stochastic.

With the law of the stochastic force in the windows, a force that is a simple function of one measured input
(`InputForces`) is asked for in every degree of freedom. The one is taken whose gain on runs left out is surest, and its
mean square is compared with that of what stays stochastic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.residuals.additive_force_test import _by_part
from auvnn.diagnosis.residuals.input_forces import ANGLES, AXES, InputForces, _euler, _raw
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Share of a degree of freedom's force that measured inputs may predict (lower 95 % limit) before it is no noise.
PREDICTABLE = 0.1
# Standard errors of a gain on runs left out, below which it may be chance; many inputs are asked.
SURE = 3.0
# One-sided 95 per cent.
LIMIT = 1.645


@dataclass(frozen=True)
class InputPrediction:
    """The share of a degree of freedom's force that a measured input predicts.

    Attributes:
        axis: "X" to "N".
        input: name.
        share: of the force's mean square, that of the stochastic force included.
        least: lower 95 % limit of the share; zero where the gain on runs left out may be chance.
        gain: fall of the weighted squared error on what is left out.
    """

    axis: str
    input: str
    share: float
    least: float
    gain: float = 0.0

    @property
    def matters(self) -> bool:
        """Whether surely more is predicted than a stochastic force leaves room for."""
        return self.least > PREDICTABLE


def predicted_by_inputs(explanation: FittedHypothesis, windows: Windows) -> InputPrediction | None:
    """Return the largest share that is predicted, None where there is no stochastic force.

    Args:
        explanation: the fit under the law.
        windows: with the law.
    """
    law = windows.law
    if law is None or not law.axes:
        return None
    fitted = explanation.fitted
    probe = InputForces(fitted.model, windows)
    features = _features(probe, windows)
    known = len(fitted.theta)
    scale = np.array([p.scale for p in probe.parameters_of])
    parts: list[list[Statistics]] = [[] for _ in AXES]
    for part in _by_part(explanation, probe, windows, fitted.sigma):
        for axis, one in zip(parts, part, strict=True):
            axis.append(one)
    fold, best = folds(windows.run), None
    for i in law.axes:
        hessian = np.concatenate([s.hessian for s in parts[i]])
        slope = np.concatenate([s.slope for s in parts[i]])
        cost = np.concatenate([s.cost for s in parts[i]])
        one = parts[i][0]
        whole = Statistics(
            hessian, slope, cost, one.channel, one.count, one.rough, one.pairs, windows.run, windows.first
        )
        before = _left(whole, list(range(known)), explanation, scale[:0], fold)
        for name, place in probe.inputs.items():
            if name == "t":
                continue
            own = np.arange(len(scale) // 6)[place]
            size = scale[own + i * (len(scale) // 6)]
            columns = [*range(known), *(known + own)]
            gain = before - _left(whole, columns, explanation, size, fold)
            z = float(gain.sum()) / max(float(np.sqrt(len(gain)) * gain.std(ddof=1)), 1e-300)
            found = _share(whole, columns, explanation, size, features[:, own], float(law.rms[i]))
            least = found[1] if z > SURE else 0.0
            predicted = InputPrediction(AXES[i], name, found[0], least, float(gain.sum()))
            if best is None or (predicted.least, predicted.share) > (best.least, best.share):
                best = predicted
    return best


def _share(
    sums: Statistics,
    columns: list[int],
    explanation: FittedHypothesis,
    size: Array,
    features: Array,
    rms: float,
) -> tuple[float, float]:
    """Return the share of the mean square that a force of some features has, and its lower limit."""
    fitted, known = explanation.fitted, len(explanation.fitted.theta)
    some = sums.columns(columns)
    held = fitted.priors.extended_by(size**-2.0)
    square = some.total + held.square
    unit = 1.0 / np.sqrt(np.maximum(np.diag(square), 1e-300))
    square = square * unit[:, None] * unit
    covariance = np.linalg.pinv(square, hermitian=True) * unit[:, None] * unit
    pull = held.pull(np.concatenate([fitted.theta, np.zeros(len(size))]))
    step = (covariance @ (some.slope.sum(0) - pull))[known:]
    spread = covariance[known:, known:]
    gram = np.cov(features.T).reshape(len(size), len(size))
    inside = gram @ spread
    mean_square = float(step @ gram @ step) - float(np.trace(inside))
    error = np.sqrt(
        max(4.0 * float(step @ gram @ spread @ gram @ step) + 2.0 * float(np.trace(inside @ inside)), 0.0)
    )
    least = max(mean_square - LIMIT * error, 0.0)
    mean_square = max(mean_square, 0.0)
    return mean_square / (mean_square + rms**2), least / (least + rms**2)


def _left(
    sums: Statistics, columns: list[int], explanation: FittedHypothesis, size: Array, fold: NDArray[np.int64]
) -> Array:
    fitted = explanation.fitted
    held = fitted.priors.extended_by(size**-2.0)
    return left_out(sums.columns(columns), np.concatenate([fitted.theta, np.zeros(len(size))]), held, fold)


def _features(probe: InputForces, windows: Windows) -> Array:
    """Return the functions of the inputs at all samples, (N, k), in the order of one degree of freedom's parameters."""
    given = windows.inputs.rows(windows.warmup)
    raw = _raw(
        windows.times[:, windows.warmup :], windows.eta[..., :3], _euler(windows.eta[..., 3:]), windows.nu,
        given.command, given.fins, given.voltage, given.altitude,
    )  # fmt: skip
    seen = torch.as_tensor(np.arange(raw.shape[1]) < windows.length[:, None])
    values = raw[seen].numpy()
    names = _names_of(probe, windows, raw.shape[-1])
    columns = []
    for name in probe.inputs:
        k = names.index(name)
        x = values[:, k]
        if name in ANGLES:
            columns += [np.sin(x), np.cos(x), np.sin(2 * x), np.cos(2 * x)]
        else:
            z = (x - float(probe.kept("mean")[k])) / float(probe.kept("spread")[k])
            columns += [z, z * z, np.abs(z) * z]
    return np.stack(columns, axis=-1)


def _names_of(probe: InputForces, windows: Windows, count: int) -> list[str]:
    """Return the name of every column of the raw inputs; those that stand still have none."""
    names = [""] * count
    for name, k in zip(probe.inputs, probe._moving, strict=True):
        names[k] = name
    return names
