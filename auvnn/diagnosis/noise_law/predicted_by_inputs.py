"""How much of a force the measured inputs predict: that part is not stochastic.

A force that is a simple function of one measured input (`InputForces`) is asked for in every degree of freedom, beside
the stochastic one: its course over the cells of the law is known but for its size. Windows are conditional on those
before them, so that a slow force that looks like an input by chance does not count anew in each. Of inputs whose gain on
runs left out is sure, those that gain most are taken, and the law is estimated again with each of them in the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out
from auvnn.diagnosis.noise_law.likelihood.estimate_law import estimate
from auvnn.diagnosis.noise_law.likelihood.known_forces import with_known_forces
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.diagnosis.residuals.input_forces import ANGLES, AXES, InputForces
from auvnn.estimation.trajectories.windows_in_turn import SAME_MOMENT
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.free_run import predict
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Share of a degree of freedom's force that measured inputs may predict (lower 95 % limit) before it is no noise.
PREDICTABLE = 0.1
# Standard errors of a gain on runs left out, below which it may be chance; many inputs are asked.
SURE = 3.0
# Measured motion: it answers the force, in open loop too.
MOTION = (*"uvwpqr", *ANGLES, *"xyz", "altitude")
# Inputs with each of which the law is estimated again, and the steps of that.
LOOKED, STEPS = 3, 10
# One-sided 95 per cent.
LIMIT = 1.645


@dataclass(frozen=True)
class InputPrediction:
    """The share of a degree of freedom's force that a measured input predicts.

    Attributes:
        axis: "X" to "N".
        input: name.
        share: of the force's mean square.
        least: lower 95 % limit of the share.
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
    explanation: FittedHypothesis,
    windows: Windows,
    sums: ForceSums,
    law: ForceLaw | None,
    *,
    closed_loop: bool = False,
) -> InputPrediction | None:
    """Return the largest share that is predicted; None where no input surely predicts any, or there is no force.

    The share's limit has the relative uncertainty of the gain.

    Args:
        explanation: the fit under the law.
        windows: without a law.
        sums: of these windows at the fit.
        law: of the force that is left.
        closed_loop: whether commands answer the motion.
    """
    if law is None or not law.axes:
        return None
    probe = InputForces(explanation.fitted.model, windows)
    courses = _courses(probe, explanation, windows, sums, closed_loop)
    known, each = len(explanation.fitted.theta), courses.shape[-1]
    scale = np.array([p.scale for p in probe.parameters_of]).reshape(6, each)
    fold = folds(windows.run)
    surest: list[tuple[float, float, int, str]] = []
    for i in law.axes:
        whole = Likelihood(with_known_forces(sums, i, courses, scale[i])).by_window(law).finite()
        before = _left(whole, list(range(known)), explanation, scale[i, :0], fold)
        for name, place in probe.inputs.items():
            own = np.arange(each)[place]
            columns = [*range(known), *(known + own)]
            gain = before - _left(whole, columns, explanation, scale[i, own], fold)
            z = float(gain.sum()) / max(float(np.sqrt(len(gain)) * gain.std(ddof=1)), 1e-300)
            if z > SURE and name != "t":
                surest.append((float(gain.sum()), z, i, name))
    best: InputPrediction | None = None
    for gain, z, i, name in sorted(surest, reverse=True)[:LOOKED]:
        own = np.arange(each)[probe.inputs[name]]
        beside = with_known_forces(sums, i, courses[..., own], scale[i, own])
        left = estimate(Likelihood(beside), law, law.axes, STEPS).law
        # What is left of the force says how much was predicted: parameters of the model that take the opposite force
        # upon them leave much of it, however large the part that the input has.
        share = 1.0 if left is None else max(1.0 - float(left.rms[i] / law.rms[i]) ** 2, 0.0)
        predicted = InputPrediction(AXES[i], name, share, share * max(1.0 - LIMIT / z, 0.0), gain)
        if best is None or (predicted.least, predicted.share) > (best.least, best.share):
            best = predicted
    return best


def _left(
    sums: Statistics, columns: list[int], explanation: FittedHypothesis, size: Array, fold: NDArray[np.int64]
) -> Array:
    fitted = explanation.fitted
    held = fitted.priors.extended_by(size**-2.0)
    return left_out(sums.columns(columns), np.concatenate([fitted.theta, np.zeros(len(size))]), held, fold)


def _courses(
    probe: InputForces, explanation: FittedHypothesis, windows: Windows, sums: ForceSums, answers: bool
) -> Array:
    """Return what the functions of the inputs are in each cell, (B, K, k), along the explanation's trajectories.

    The motion answers the force: what it was as a cell begins is known before the force in that cell acts, and says
    nothing of it where it is stochastic. So do commands where a controller makes them; of others the mean over the cell
    counts.
    """
    seen = np.arange(windows.eta.shape[1]) < windows.length[:, None]
    values = np.where(seen[..., None], _along(probe, explanation, windows).numpy(), 0.0)
    times = windows.times[:, windows.warmup :].numpy()
    since = np.where(seen, times - times[:, :1], np.inf)
    window, begins = np.arange(len(values))[:, None], sums.cell * np.arange(sums.cells)
    last = (since[:, None] <= begins[:, None] + SAME_MOMENT).sum(-1) - 1
    first = values[window, last]
    if answers:
        return first
    cell = np.minimum((since / sums.cell + SAME_MOMENT), sums.cells - 1.0).astype(np.int64)
    total, count = np.zeros_like(first), np.zeros(first.shape[:2])
    np.add.at(total, (window, cell), values)
    np.add.at(count, (window, cell), seen)
    # Where samples are further apart than cells, what was before goes on.
    means = np.where(count[..., None] > 0, total / np.maximum(count, 1.0)[..., None], first)
    for name, place in probe.inputs.items():
        if name in MOTION:
            means[..., place] = first[..., place]
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
