"""How much of a force the measured inputs predict: that part is not stochastic.

A force that is a simple function of one measured input (`InputForces`) is asked for in every degree of freedom, beside
the stochastic one: its mean over the cells of the law is known but for its size. Windows are conditional on those before
them, so that a slow force that looks like an input by chance does not count anew in each. The input is taken whose gain
on runs left out is surest, and its mean square is compared with that of the force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.noise_law.likelihood.known_forces import with_known_forces
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.diagnosis.residuals.input_forces import AXES, InputForces
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw, covariance_of_means
from auvnn.metrics.free_run import predict
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
        share: of the force's mean square.
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


def predicted_by_inputs(
    explanation: FittedHypothesis, windows: Windows, sums: ForceSums, law: ForceLaw | None
) -> InputPrediction | None:
    """Return the largest share that is predicted, None where there is no stochastic force.

    Args:
        explanation: the fit under the law.
        windows: without a law.
        sums: of these windows at the fit.
        law: of the force that is left.
    """
    if law is None or not law.axes:
        return None
    probe = InputForces(explanation.fitted.model, windows)
    courses = _courses(probe, explanation, windows, sums)
    known, each = len(explanation.fitted.theta), courses.shape[-1]
    scale = np.array([p.scale for p in probe.parameters_of]).reshape(6, each)
    fold, best = folds(windows.run), None
    for i in law.axes:
        whole = Likelihood(with_known_forces(sums, i, courses, scale[i])).by_window(law).finite()
        before = _left(whole, list(range(known)), explanation, scale[i, :0], fold)
        mean = float(covariance_of_means(1, sums.cell, torch.tensor(float(law.time[i]))))
        for name, place in probe.inputs.items():
            if name == "t":
                continue
            own = np.arange(each)[place]
            size = scale[i, own]
            columns = [*range(known), *(known + own)]
            gain = before - _left(whole, columns, explanation, size, fold)
            z = float(gain.sum()) / max(float(np.sqrt(len(gain)) * gain.std(ddof=1)), 1e-300)
            features = courses[..., own].reshape(-1, len(own))
            found = _share(whole, columns, explanation, size, features, float(law.rms[i]) * mean**0.5)
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
    # The law was estimated without the known force, which is in its mean square.
    whole = max(mean_square, rms**2, 1e-300)
    return mean_square / whole, least / whole


def _left(
    sums: Statistics, columns: list[int], explanation: FittedHypothesis, size: Array, fold: NDArray[np.int64]
) -> Array:
    fitted = explanation.fitted
    held = fitted.priors.extended_by(size**-2.0)
    return left_out(sums.columns(columns), np.concatenate([fitted.theta, np.zeros(len(size))]), held, fold)


def _courses(probe: InputForces, explanation: FittedHypothesis, windows: Windows, sums: ForceSums) -> Array:
    """Return the mean over each cell of the functions of the inputs, (B, K, k), along the explanation's trajectories."""
    seen = torch.as_tensor(np.arange(windows.eta.shape[1]) < windows.length[:, None])
    values = torch.where(seen[..., None], _along(probe, explanation, windows), 0.0).numpy()
    times = windows.times[:, windows.warmup :].numpy()
    cell = ForceLaw(np.ones(6), np.ones(6), sums.cell, sums.span).cell_of(times - times[:, :1])
    total, count = np.zeros((len(values), sums.cells, values.shape[-1])), np.zeros((len(values), sums.cells))
    window = np.arange(len(values))[:, None]
    np.add.at(total, (window, cell), values)
    np.add.at(count, (window, cell), seen.numpy())
    means = total / np.maximum(count, 1.0)[..., None]
    for k in range(1, sums.cells):
        # Where samples are further apart than cells, what was before goes on.
        means[:, k] = np.where(count[:, k, None] > 0, means[:, k], means[:, k - 1])
    return means


def _along(probe: InputForces, explanation: FittedHypothesis, windows: Windows) -> Tensor:
    """Return the functions of the inputs at all samples, (B, L, k)."""
    around = explanation.around
    with torch.no_grad():
        eta, nu = (
            predict(explanation.fitted.model, windows, explanation.fitted.initial)
            if around is None
            else (around[..., :7], around[..., 7:])
        )
        return probe.along(windows, eta, nu)
