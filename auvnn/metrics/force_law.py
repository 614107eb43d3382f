"""A stochastic force: per degree of freedom a variance and a correlation time.

What the equations lack and nobody measured is taken as an Ornstein-Uhlenbeck force on the body,

    E[f(t) f(s)] = rms^2 exp(-|t - s| / time),

one process per degree of freedom, independent of the others. In a window it is taken as constant over short cells
that count from the window's start; the value in a cell is the mean of the process over the cell, whose covariance is
known exactly, so that the impulse over each cell is that of the process.

References: Uhlenbeck and Ornstein (1930), Physical Review 36; Kristensen, Madsen and Joergensen (2004), Automatica 40(2)
225-237, for stochastic terms in grey-box models.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[np.float64]
# Cells are half as long as the shortest correlation time, within these, s: shorter ones cost time, longer ones let
# the force change too much within a cell.
SHORTEST, LONGEST = 0.2, 0.5


@dataclass(frozen=True)
class ForceLaw:
    """The law of a stochastic force, in the body's axes at its origin.

    Attributes:
        rms: (6,) standard deviations, N and N m; zero where there is none.
        time: (6,) correlation times, s.
        cell: length of the cells, s.
        span: longest window, s.
        plain: cells of unit variance that do not hang together; for the estimate of the law itself.
        response: (6, 6) acceleration that a unit of the force gives, whatever the model's inertia is; that of the model
            itself where None. With a response of its own the spread of what is predicted does not change with the
            inertia, so that steps of Gauss and Newton, which do not see that it would, lead to the likeliest values.
    """

    rms: Array
    time: Array
    cell: float
    span: float
    plain: bool = False
    response: Array | None = None

    @cached_property
    def axes(self) -> list[int]:
        """Degrees of freedom in which there is a force."""
        return [int(i) for i in np.flatnonzero(self.rms > 0.0)]

    @property
    def cells(self) -> int:
        """How many cells a window has."""
        return max(int(np.ceil(self.span / self.cell - 1e-9)), 1)

    @cached_property
    def factors(self) -> Array:
        """Cholesky factors of the cells' covariances, (A, K, K), in N and N m."""
        if self.plain:
            return np.broadcast_to(np.eye(self.cells), (len(self.axes), self.cells, self.cells))
        return np.stack(
            [
                self.rms[i] * np.linalg.cholesky(correlation(self.cells, self.cell, self.time[i]))
                for i in self.axes
            ]
        )

    def mean_over(self, duration: float) -> Array:
        """Return the rms of the force's mean over some time, s, (6,): what changes faster moves a vehicle little."""
        return self.rms * np.sqrt(np.minimum(1.0, 2.0 * self.time / duration))

    def cell_of(self, since: Array) -> NDArray[np.int64]:
        """Return the cell of moments so long after a window's start, s."""
        return np.clip((since / self.cell + 1e-9).astype(np.int64), 0, self.cells - 1)


def cell_for(time: Array) -> float:
    """Return how long the cells are for forces of some correlation times, s."""
    return float(np.clip(0.5 * np.min(time, initial=2 * LONGEST), SHORTEST, LONGEST))


def correlation(count: int, cell: float, time: float) -> Array:
    """Return the covariance of a unit process's means over successive cells, (count, count).

    Args:
        count: of cells.
        cell: their length, s.
        time: correlation time, s.
    """
    return covariance_of_means(count, cell, torch.tensor(float(time), dtype=torch.float64)).numpy()


def given_the_first(count: int, cell: float, time: Tensor) -> tuple[Tensor, Tensor]:
    """Return what a unit process's means over cells and its value at their end are by the value with which they begin.

    Args:
        count: of cells.
        cell: their length, s.
        time: correlation times, s, (...).

    Returns:
        what they are expected to be after a value of one, (..., count + 1); root of their covariance, given that value,
        (..., count + 1, count + 1).
    """
    on = torch.cat([after(count, cell, time), torch.exp(-count * cell / time)[..., None]], dim=-1)
    return on, torch.linalg.cholesky(
        covariance_with_end(count, cell, time) - on[..., None] * on[..., None, :]
    )


def covariance_with_end(count: int, cell: float, time: Tensor) -> Tensor:
    """Return the covariance of a unit process's means over cells and, last, its value at their end.

    It is (..., count + 1, count + 1). With a = cell / time the mean of the cell that is k before the last one has
    exp(-k a) (1 - exp(-a)) / a with that value. What follows depends on what was before by that value alone: the process
    is Markov, its means are not.

    Args:
        count: of cells.
        cell: their length, s.
        time: correlation times, s, (...).
    """
    end = after(count, cell, time).flip(-1)
    means = covariance_of_means(count, cell, time)
    last = torch.cat([end, torch.ones_like(end[..., :1])], dim=-1)
    return torch.cat(
        [torch.cat([means, end[..., None]], dim=-1), last[..., None, :]], dim=-2
    ) + 1e-9 * torch.eye(count + 1, dtype=torch.float64)


def after(count: int, cell: float, time: Tensor) -> Tensor:
    """Return what means over cells (..., count) are expected to be after a value of one, as shares of it.

    Args:
        count: of cells.
        cell: their length, s.
        time: correlation times, s, (...).
    """
    a = (cell / time)[..., None]
    return torch.exp(-a * torch.arange(count, dtype=torch.float64)) * -torch.expm1(-a) / a


def covariance_of_means(count: int, cell: float, time: Tensor) -> Tensor:
    """Return the same without the value at the end, (..., count, count), differentiable in the correlation time.

    With a = cell / time it is 2 (a - 1 + exp(-a)) / a^2 within a cell, and between cells that are k apart
    exp(-k a) (exp(a) - 2 + exp(-a)) / a^2, the integral of exp(-|t - s| / time) over both, divided by cell^2.

    Args:
        count: of cells.
        cell: their length, s.
        time: correlation times, s, (...).
    """
    a = (cell / time)[..., None, None]
    apart = (torch.arange(count)[:, None] - torch.arange(count)).abs().to(torch.float64)
    # Of cells that are this short the means are values, and differences of numbers close to one mean nothing.
    short = a < 1e-4
    size = torch.where(short, torch.ones_like(a), a)
    own = 2.0 * (size + torch.expm1(-size)) / size**2
    # exp(-k a) (exp(a) - 2 + exp(-a)) = exp(-(k - 1) a) (1 - exp(-a))^2.
    across = torch.exp(-torch.clamp(apart - 1.0, min=0.0) * size) * torch.expm1(-size) ** 2 / size**2
    values = torch.exp(-torch.where(short, a, torch.zeros_like(a)) * apart)
    values = values + 1e-9 * torch.eye(count, dtype=torch.float64)
    return torch.where(short, values, torch.where(apart == 0, own * (1.0 + 1e-9), across))
