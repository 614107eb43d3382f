"""What windows say about a stochastic force in cells, with the parameters of a fit: small sums, window by window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.estimation.priors import Priors
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Cells of the force while its law is looked for, s.
CELL = 0.5


@dataclass(frozen=True)
class ForceSums:
    """What the windows say about parameters and of a force in cells, about a fit.

    Attributes:
        statistics: columns are those of the fit's parameters, then the cells of X, Y, ... N.
        known: parameters.
        cells: of each degree of freedom.
        theta: (P,) where the windows were linearised.
        mean: (P,) of the parameters' priors.
        precision: (P,) of the same.
        inside: (P,) which parameters can move.
        sizes: (6,) plausible forces, N and N m.
        times: shortest and longest correlation time, s.
        span: longest window, s.
        cell: length of the cells, s.
        joint: (P, P) precision of all parameters together, where some go together.
    """

    statistics: Statistics
    known: int
    cells: int
    theta: Array
    mean: Array
    precision: Array
    inside: NDArray[np.bool_]
    sizes: Array
    times: tuple[float, float]
    span: float
    cell: float
    joint: Array | None = None

    @property
    def priors(self) -> Priors:
        """What is assumed of the parameters."""
        return Priors(self.mean, self.precision, None, self.joint)


def force_sums(
    explanation: FittedHypothesis, windows: Windows, sigma: Array, cell: float = CELL
) -> ForceSums:
    """Linearise the windows towards the parameters of a fit and a force in cells.

    Args:
        explanation: the fit.
        windows: those it was fitted to; a law of theirs is not looked at.
        sigma: (18,) the sensors' white noise, infinite for channels that do not count.
        cell: s.
    """
    fitted, vehicle = explanation.fitted, explanation.fitted.model.vehicle
    times = windows.times[:, windows.warmup :]
    span = float((times[:, -1] - times[:, 0]).max())
    plain = ForceLaw(np.ones(6), np.ones(6), cell, span, plain=True)
    asked = replace(windows, law=plain)

    def joined() -> Iterator[Response]:
        for answer in linearise(fitted.model, asked, fitted.initial, explanation.names):
            assert answer.force is not None
            yield Response(answer.error, answer.state, torch.cat([answer.parameters, answer.force], dim=-1))

    statistics, _, _ = normal_equations(windows, joined(), sigma)
    force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
    steps = (times[:, 1:] - times[:, :-1]).numpy()
    runs = [
        float(times[windows.run == r].max() - times[windows.run == r].min()) for r in np.unique(windows.run)
    ]
    shortest = 2.0 * float(np.median(steps[steps > 0]))
    priors = fitted.priors
    return ForceSums(
        statistics, len(fitted.theta), plain.cells, fitted.theta, priors.mean, priors.precision,
        priors.inside(fitted.theta), np.array([force] * 3 + [0.1 * force * float(vehicle.length)] * 3),
        (shortest, max(0.1 * max(runs), 2.0 * shortest)), span, cell, priors.joint,
    )  # fmt: skip
