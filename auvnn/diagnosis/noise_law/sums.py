"""What windows say about a stochastic force in cells, with the parameters of a fit: small sums, window by window."""

from __future__ import annotations

import itertools
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
# Windows of a chain.
CHAIN = 10


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
        before: (B,) the window that each one follows, -1 where none does; None where none follows any.
        gap: (B,) time between the cells of that window and its own, s.
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
    before: NDArray[np.int64] | None = None
    gap: Array | None = None

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
        np.ones(len(fitted.theta), dtype=bool), np.array([force] * 3 + [0.1 * force * float(vehicle.length)] * 3),
        (shortest, max(0.1 * max(runs), 2.0 * shortest)), span, cell, priors.joint,
        *followed(windows, plain.cells * cell),
    )  # fmt: skip


def followed(windows: Windows, reach: float) -> tuple[NDArray[np.int64], Array]:
    """Return the window that each one follows in its run, -1 where none does, and the time between them, s, (B,) each.

    A chain begins anew after so many windows: what is known of a force ten windows ago says no more.

    Args:
        windows: B windows.
        reach: time from a window's start to the end of its last cell, s.
    """
    times = windows.times[:, windows.warmup :].numpy()
    begin, end = times[:, 0], times[:, -1]
    before, gap = np.full(len(begin), -1), np.zeros(len(begin))
    linked = 0
    order = np.lexsort((begin, windows.run))
    for one, other in itertools.pairwise(order):
        whole = end[one] - begin[one] > 0.9 * reach
        same = windows.run[one] == windows.run[other] and begin[other] >= end[one] - 1e-9
        linked = linked + 1 if same and whole and linked + 1 < CHAIN else 0
        if linked:
            before[other] = one
            gap[other] = max(begin[other] - begin[one] - reach, 0.0)
    return before, gap
