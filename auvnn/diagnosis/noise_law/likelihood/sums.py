"""What windows say about a stochastic force in cells, with the parameters of a fit: small sums, window by window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.estimation.priors import Priors, limits
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.trajectories.windows_in_turn import followed, offsets
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Cells of the force while its law is looked for, s.
CELL = 0.5


@dataclass(frozen=True)
class States:
    """What windows say of their initial states, and where these lead: by that windows of a run hang together.

    Attributes:
        square: (B, 12, 12) J^T J of the initial states.
        across: (B, 12, 1 + P + F) the same with the errors, the parameters and the force.
        ends: (B, 12, 12 + P + F + 1) change of the last state with the initial one, the parameters, the force, and from
            the trajectory to where its intervals lead.
        offset: (B, 12) from a window's first state to the last one of the window that it follows.
        follows: (B,) whether the window begins with the sample with which the one that it follows ends.
    """

    square: Array
    across: Array
    ends: Array
    offset: Array
    follows: NDArray[np.bool_]


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
        reach: (2, P) least and largest steps that parameters can make.
        sizes: (6,) plausible forces, N and N m.
        times: shortest and longest correlation time, s.
        span: longest window, s.
        cell: length of the cells, s.
        joint: (P, P) precision of all parameters together, where some go together.
        before: (B,) the window that each one follows, -1 where none does; None where none follows any.
        gap: (B,) time between the cells of that window and its own, s.
        states: what goes from window to window beside the force; None where only the force does.
        response: of the law, see `ForceLaw`.
    """

    statistics: Statistics
    known: int
    cells: int
    theta: Array
    mean: Array
    precision: Array
    reach: Array
    sizes: Array
    times: tuple[float, float]
    span: float
    cell: float
    joint: Array | None = None
    before: NDArray[np.int64] | None = None
    gap: Array | None = None
    states: States | None = None
    response: Array | None = None

    @property
    def priors(self) -> Priors:
        """What is assumed of the parameters."""
        return Priors(self.mean, self.precision, None, self.joint)


def force_sums(
    explanation: FittedHypothesis,
    windows: Windows,
    sigma: Array,
    cell: float = CELL,
    response: Array | None = None,
) -> ForceSums:
    """Linearise the windows towards the parameters of a fit and a force in cells.

    Args:
        explanation: the fit.
        windows: those it was fitted to; a law of theirs is not looked at.
        sigma: (18,) the sensors' white noise, infinite for channels that do not count.
        cell: s.
        response: of the law, see `ForceLaw`.
    """
    fitted, vehicle = explanation.fitted, explanation.fitted.model.vehicle
    times, span = windows.times[:, windows.warmup :], span_of(windows)
    plain = ForceLaw(np.ones(6), np.ones(6), cell, span, plain=True, response=response)
    before, gap = followed(windows, plain.cells * cell)
    offset, follows = np.zeros((len(windows), 12)), np.zeros(len(windows), dtype=bool)
    if windows.around is not None and windows.noise is None:
        # Noise that is not white would go on from window to window, too: then each begins with a state of its own.
        offset, same = offsets(windows, windows.around, before)
        offset, follows = offset.numpy(), same.numpy()
        # The sample that two windows share was measured once.
        mask = windows.mask.clone()
        mask[torch.as_tensor(follows), 0] = 0.0
        windows = replace(windows, mask=mask)
    asked = replace(windows, law=plain)

    rows = None if windows.around is None else slice(-1, None)
    weight = torch.as_tensor(np.where(np.isfinite(sigma), 1.0 / sigma, 0.0))
    parts: list[tuple[Tensor, Tensor, Tensor]] = []

    def joined() -> Iterator[Response]:
        for answer in linearise(fitted.model, asked, fitted.initial, explanation.names, motion=rows):
            assert answer.force is not None
            whole = torch.cat([answer.parameters, answer.force], dim=-1)
            if answer.motion is not None:
                parts.append((*_of_states(answer, whole, weight), answer.motion[:, -1]))
            yield Response(answer.error, answer.state, whole)

    statistics, _, _ = normal_equations(windows, joined(), sigma)
    force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
    steps = (times[:, 1:] - times[:, :-1]).numpy()
    runs = [
        float(times[windows.run == r].max() - times[windows.run == r].min()) for r in np.unique(windows.run)
    ]
    shortest = 2.0 * float(np.median(steps[steps > 0]))
    priors = fitted.priors
    reach = np.stack(limits(fitted.model, explanation.names, priors)) - fitted.theta
    states = None
    if windows.around is not None:
        square, across, ends = (torch.cat(p).numpy() for p in zip(*parts, strict=True))
        states = States(square, across, ends, offset, follows)
    return ForceSums(
        statistics, len(fitted.theta), plain.cells, fitted.theta, priors.mean, priors.precision,
        reach, np.array([force] * 3 + [0.1 * force * float(vehicle.length)] * 3),
        (shortest, max(0.1 * max(runs), 2.0 * shortest)), span, cell, priors.joint,
        before, gap, states, response,
    )  # fmt: skip


def span_of(windows: Windows) -> float:
    """Return the length of the longest window, s."""
    times = windows.times[:, windows.warmup :]
    return float((times[:, -1] - times[:, 0]).max())


def whole_cells(windows: Windows, cell: float) -> float:
    """Return the length of cells, s, no longer than this one, of which the longest window holds a whole number.

    Args:
        windows: B windows.
        cell: s.
    """
    span = span_of(windows)
    return span / max(float(np.ceil(span / cell - 1e-9)), 1.0)


def _of_states(answer: Response, whole: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Return the products of a response's initial states with themselves, and with errors, parameters and force."""
    told = answer.state.shape[2]
    heavy = (answer.state * weight[:told, None] ** 2).flatten(1, 2).mT
    error = heavy @ answer.error[..., :told].flatten(1, 2).unsqueeze(-1)
    return heavy @ answer.state.flatten(1, 2), torch.cat([error, heavy @ whole.flatten(1, 2)], dim=-1)
