"""Windows reduced to sums that add up: what a fit and a test need of a log that does not fit into memory.

`Statistics` holds a matrix for each window; over all of a long log only their sums matter, and the second moments of
the windows' scores, neighbours included, which tell how much more they vary than white noise would. Both are sums
over parts of the log, added in the order of the parts, so that who computed which part changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, as_tensor

from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]

S = TypeVar("S", "WindowSums", "ScoreMoments")


@dataclass(frozen=True)
class WindowSums:
    """Sums over windows, initial states projected out; see `Statistics` for the terms.

    Attributes:
        hessian: J^T J, (P, P).
        slope: J^T e, (P,).
        cost: e^T e.
        channel: squared errors, (18,).
        count: samples, (18,).
        rough: squared differences of successive errors, (18,).
        pairs: differences, (18,).
        windows: how many.
    """

    hessian: Array
    slope: Array
    cost: float
    channel: Array
    count: Array
    rough: Array
    pairs: Array
    windows: int

    @classmethod
    def of(cls, statistics: Statistics) -> Self:
        """Return the sums of windows that have been reduced."""
        s = statistics
        channel, count, rough, pairs = (x.sum(0) for x in (s.channel, s.count, s.rough, s.pairs))
        return cls(
            s.hessian.sum(0),
            s.slope.sum(0),
            float(s.cost.sum()),
            channel,
            count,
            rough,
            pairs,
            len(s.cost),
        )

    def __add__(self, other: Self) -> Self:
        """Return the sums over both."""
        mine, theirs = vars(self), vars(other)
        return type(self)(**{name: mine[name] + theirs[name] for name in mine})

    def spread(self, floor: Array, parameters: int) -> Array:
        """Return each channel's root-mean-square error, (18,), as `normal_equations.residual_std` does."""
        spent = (12 * self.windows + parameters) * self.count / max(self.count.sum(), 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.sqrt(self.channel / np.maximum(self.count - spent, 0.25 * self.count))
        return np.where(self.count > 0, np.maximum(value, floor), np.inf)


@dataclass(frozen=True)
class Combination:
    """Linear combinations of a window's sums: T s - U H w, with s its scores (P,) and H its matrix (P, P).

    Attributes:
        scores: T, (p, P).
        moved: U, (p, P).
        step: w, (P,).
    """

    scores: Array
    moved: Array
    step: Array

    def of(self, statistics: Statistics) -> Array:
        """Return the combinations of each window, (B, p)."""
        found = statistics.slope @ self.scores.T
        if self.step.any():
            found = found - (statistics.hessian @ self.step) @ self.moved.T
        return found


@dataclass(frozen=True)
class InformationShares:
    """What each window knows of some parameters as a share of what all do: A_b = R^T U H_b U^T R, H_b its matrix (P, P).

    Attributes:
        moved: U, how all columns follow these parameters, (p, P).
        root: R, (p, r), with R R^T the inverse of the information of all windows.
    """

    moved: Array
    root: Array

    def of(self, statistics: Statistics) -> Array:
        """Return the shares of each window, row by row, (B, r r)."""
        return self.rows(self.moved @ statistics.hessian @ self.moved.T, self.root)

    @staticmethod
    def rows(information: Array, root: Array) -> Array:
        """Return the shares of windows of known information, (B, p, p), row by row, (B, r r)."""
        return (root.T @ information @ root).reshape(len(information), -1)


@dataclass(frozen=True)
class ScoreMoments:
    """Second moments of vectors u (p,), one per window in the order of time, and of neighbours in a run.

    Attributes:
        count: windows.
        total: sum of u, (p,).
        square: sum of u u^T, (p, p).
        joined: how many windows have a neighbour after them.
        lagged: sum of u_next u^T over those, (p, p).
        before: sum of u over those, (p,).
        after: sum of u_next over those, (p,).
        first: run and u of the first window.
        last: run and u of the last window.
    """

    count: int
    total: Array
    square: Array
    joined: int
    lagged: Array
    before: Array
    after: Array
    first: tuple[int, Array]
    last: tuple[int, Array]

    @classmethod
    def of(cls, vectors: Array, run: NDArray[np.int64]) -> Self:
        """Return the moments of some windows' vectors (B, p), B at least one."""
        beside = run[1:] == run[:-1]
        now, then = vectors[:-1][beside], vectors[1:][beside]
        return cls(
            len(vectors),
            vectors.sum(0),
            vectors.T @ vectors,
            int(beside.sum()),
            then.T @ now,
            now.sum(0),
            then.sum(0),
            (int(run[0]), vectors[0]),
            (int(run[-1]), vectors[-1]),
        )

    def __add__(self, other: Self) -> Self:
        """Return the moments of these windows and of those that come after them."""
        here, there = self.last[1], other.first[1]
        beside = self.last[0] == other.first[0]
        return type(self)(
            self.count + other.count,
            self.total + other.total,
            self.square + other.square,
            self.joined + other.joined + beside,
            self.lagged + other.lagged + beside * np.outer(there, here),
            self.before + other.before + beside * here,
            self.after + other.after + beside * there,
            self.first,
            other.last,
        )

    def spread(self) -> Array:
        """Return the sum of products about the mean, neighbours counting half (Bartlett), (p, p)."""
        mean = self.total / self.count
        square = self.square - self.count * np.outer(mean, mean)
        lagged = (
            self.lagged
            - np.outer(self.after, mean)
            - np.outer(mean, self.before)
            + self.joined * np.outer(mean, mean)
        )
        return square + 0.5 * (lagged + lagged.T)


def add_parts(parts: Iterable[S]) -> S:
    """Return the sum of at least one, from the first to the last."""
    iterator = iter(parts)
    total = next(iterator)
    for part in iterator:
        total = total + part
    return total


def reduce_windows(
    model: GreyBox, windows: Windows, initial: Tensor, names: Sequence[str], sigma: Array
) -> tuple[Statistics, Tensor]:
    """Return windows' statistics towards the named effects' parameters, and their initial states after a step.

    Args:
        model: at the values about which it is linearised.
        windows: of the log, B of them.
        initial: their initial states, (B, 13).
        names: effects whose parameters are differentiated by.
        sigma: standard deviation of each channel, (18,); infinite where it does not count.
    """
    statistics, change, _ = normal_equations(windows, linearise(model, windows, initial, names), sigma)
    return statistics, moved(initial, as_tensor(change))
