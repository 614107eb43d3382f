"""Windows one after the other, conditional on those before them: states and forces of a law integrated out.

In every window the force is a Gaussian vector: its means over cells (`ForceLaw`), and its value at the end. The next
window of the run depends on what was before by that value and, where it begins with the sample with which this one ends,
by the last state s = E v + d, with v the initial state and the force, of which E is the linear map to the end. With m and
P what is known of both from there, G the regression on them, and C what is left of the covariance,

    v ~ N(G m, G P G^T + C).

So windows count as conditional on their past, as one filter through the whole run would have it (up to chains of ten
windows): a slow force is not taken for as many independent ones as there are windows, and commands that answer the force
are conditional on it. With L L^T the covariance of v and mu its mean, minus twice the log likelihood of a window is

    c - 2 g^T mu + mu^T H mu - b^T (I + L^T H L)^-1 b + log |I + L^T H L|,    b = L^T (g - H mu).

Where windows are linear about free running, states are free in every window and the force alone goes on.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237, for likelihoods conditional on the past.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.estimation.force_marginalisation.sums import LOOSE
from auvnn.metrics.force_law import after, covariance_with_end

Index = NDArray[np.int64]
# What a state that goes on to the next window has of uncertainty at least, as a share of a loose one's.
LEAST = 1e-6


class WindowFilter:
    """The windows of one explanation.

    Args:
        sums: of its windows.
    """

    def __init__(self, sums: ForceSums) -> None:
        """Take the parts apart."""
        self.sums, n = sums, sums.known
        statistics = sums.statistics
        # Columns of the errors, then of the parameters with their sign turned: error - J theta.
        own = np.concatenate([statistics.slope[:, n:, None], statistics.hessian[:, n:, :n]], axis=2)
        plain = np.empty((len(own), 1 + n, 1 + n))
        plain[:, 0, 0], plain[:, 1:, 1:] = statistics.cost, statistics.hessian[:, :n, :n]
        plain[:, 0, 1:] = plain[:, 1:, 0] = statistics.slope[:, :n]
        force, states = statistics.hessian[:, n:, n:], sums.states
        self.seen = np.diagonal(force, axis1=1, axis2=2).sum(0)
        self.free, ends, led = 0, np.zeros((len(own), 0, force.shape[1])), np.zeros((len(own), 0, 1 + n))
        if states is not None:
            # Of the sums the best initial states were taken out: here they are variables as the force is.
            self.free = 12
            root = np.linalg.solve(states.square + np.diag(LOOSE**-2.0), states.across)
            whole = states.across.transpose(0, 2, 1) @ root
            plain = plain + whole[:, : 1 + n, : 1 + n]
            force = force + whole[:, 1 + n :, 1 + n :]
            own = own + whole[:, 1 + n :, : 1 + n]
            aside = states.across[:, :, 1 + n :]
            force = np.block([[states.square, aside], [aside.transpose(0, 2, 1), force]])
            own = np.concatenate([states.across[:, :, : 1 + n], own], axis=1)
            ends = np.concatenate([states.ends[:, :, :12], states.ends[:, :, 12 + n : -1]], axis=2)
            led = np.concatenate([states.ends[:, :, -1:], -states.ends[:, :, 12 : 12 + n]], axis=2)
        self.force, self.columns, self.plain = (torch.as_tensor(x) for x in (force, own, plain))
        self.ends, self.led = torch.as_tensor(ends), torch.as_tensor(led)
        self._asked: tuple[tuple[int, ...], Tensor, Tensor, Tensor] | None = None
        before = np.full(len(own), -1) if sums.before is None else sums.before
        self.waves = _waves(before)
        self.gap = torch.as_tensor(np.zeros(len(own)) if sums.gap is None else sums.gap)
        if states is not None:
            self.offset = torch.as_tensor(states.offset)
            self.follows = torch.as_tensor(states.follows.astype(float))

    def windows(
        self, axes: Sequence[int], rms: Tensor, time: Tensor, along: Tensor | None = None
    ) -> Iterator[tuple[Index, Tensor, Tensor]]:
        """Yield windows, their squares (n, M, M) with forces and states integrated out, and log determinants (n,).

        Args:
            axes: degrees of freedom with a force.
            rms: of each of them, (A,).
            time: of each of them, (A,), s.
            along: combinations of errors and parameters that are looked at, (1 + P, M); by default each by itself.
        """
        size, count, free = self.sums.cells, len(axes), self.free
        if self._asked is None or self._asked[0] != tuple(axes):
            self._asked = tuple(axes), *self._of_axes(axes)
        index, force, ends = self._asked[1:]
        columns, plain, led = self.columns[:, index] * (index >= 0)[:, None], self.plain, self.led
        if along is not None:
            columns, plain, led = columns @ along, along.mT @ plain @ along, led @ along
        # Means over the cells, and the value at their end, on which alone the next window depends.
        cell = self.sums.cell
        own = _blocks([rms[k] ** 2 * covariance_with_end(size, cell, time[k]) for k in range(count)])
        onto = _blocks(
            [torch.cat([after(size, cell, t), torch.exp(-size * cell / t)[None]])[:, None] for t in time]
        )
        variance = torch.diag(rms**2)
        loose = torch.diag(torch.as_tensor(LOOSE**2.0)[:free])
        begun = torch.linalg.cholesky(_blocks([loose, own]))
        # What goes on to the next window: the last state, and the force's last values.
        last = torch.zeros(count, len(index), dtype=torch.float64)
        last[torch.arange(count), free + torch.arange(1, count + 1) * (size + 1) - 1] = 1.0
        eye = torch.eye(len(index), dtype=torch.float64)
        mean = spread = None
        for where, before in self.waves:
            here = torch.as_tensor(where)
            h, g = force[here], columns[here]
            if before is None or mean is None or spread is None:
                expected, root = None, begun.expand(len(where), -1, -1)
            else:
                expected, root = self._expected(here, mean[before], spread[before], own, onto, variance, time)
            square, ahead = plain[here], g
            if expected is not None:
                ahead = g - h @ expected
                cross = g.mT @ expected
                square = square - cross - cross.mT + expected.mT @ h @ expected
            inner = torch.linalg.cholesky(root.mT @ h @ root + eye)
            half = torch.linalg.solve_triangular(inner, root.mT @ ahead, upper=False)
            yield (
                where,
                square - half.mT @ half,
                2.0 * torch.log(torch.diagonal(inner, dim1=-2, dim2=-1)).sum(-1),
            )
            if len(self.waves) > 1:
                on = torch.cat([ends[here], last.expand(len(where), -1, -1)], dim=1)
                known = torch.linalg.solve_triangular(inner, (on @ root).mT, upper=False)
                mean, spread = known.mT @ half, known.mT @ known
                if expected is not None:
                    mean = mean + on @ expected
                if free:
                    mean = torch.cat([mean[:, :free] + led[here], mean[:, free:]], dim=1)

    def _of_axes(self, axes: Sequence[int]) -> tuple[Tensor, Tensor, Tensor]:
        """Return which variables are the states and the force's of some degrees of freedom, their squares, and ends.

        Of each degree of freedom there is the value at the end besides, -1, which no measurement in the window shows.
        """
        size, free = self.sums.cells, self.free
        places = [*range(free)]
        for i in axes:
            places += [*range(free + i * size, free + (i + 1) * size), -1]
        index = torch.as_tensor(places, dtype=torch.int64)
        there = (index >= 0).to(torch.float64)
        force = self.force[:, index][:, :, index] * there[:, None] * there
        return index, force, self.ends[:, :, index] * there

    def _expected(
        self, here: Tensor, mean: Tensor, spread: Tensor, own: Tensor, onto: Tensor, variance: Tensor, time: Tensor
    ) -> tuple[Tensor, Tensor]:  # fmt: skip
        """Return what is expected of states and force of windows, (n, S + A K, M), and the root of its covariance.

        Args:
            here: the windows.
            mean: of the last states and forces of the windows that they follow, (n, S + A, M).
            spread: their covariance.
            own: covariance of a window's cells and last forces.
            onto: their regression on the force as the window begins.
            variance: of that force, where nothing is known of it.
            time: correlation times, s, (A,).
        """
        free, size = self.free, self.sums.cells
        since = torch.exp(-self.gap[here, None] / time).repeat_interleave(size + 1, dim=1)
        regression = onto * since[..., None]
        force = regression @ mean[:, free:]
        covariance = own + regression @ (spread[:, free:, free:] - variance) @ regression.mT
        if not free:
            return force, torch.linalg.cholesky(covariance)
        follows = self.follows[here, None, None]
        state = mean[:, :free] * follows
        offset = torch.zeros_like(state)
        offset[..., :1] = (self.offset[here, :, None] * follows)[..., :1]
        across = spread[:, :free, free:] @ regression.mT * follows
        least = torch.diag(torch.as_tensor((LOOSE * LEAST) ** 2))
        first = follows * (spread[:, :free, :free] + least) + (1.0 - follows) * torch.diag(
            torch.as_tensor(LOOSE**2.0)
        )
        whole = torch.cat(
            [torch.cat([first, across], dim=-1), torch.cat([across.mT, covariance], dim=-1)], dim=1
        )
        return torch.cat([state + offset, force], dim=1), torch.linalg.cholesky(whole)


def _blocks(parts: Sequence[Tensor]) -> Tensor:
    """Return matrices along a diagonal; without any, one that is empty."""
    some = [p for p in parts if p.numel()]
    return torch.block_diag(*some) if some else torch.zeros(0, 0, dtype=torch.float64)


def _waves(before: Index) -> list[tuple[Index, Index | None]]:
    """Return the windows in waves, and of each the place, in the wave before, of the window that it follows.

    Args:
        before: the window that each one follows, -1 where none does, (B,).
    """
    wave = np.flatnonzero(before < 0)
    out: list[tuple[Index, Index | None]] = [(wave, None)]
    after = np.full(len(before), -1)
    after[before[before >= 0]] = np.flatnonzero(before >= 0)
    while (after[wave] >= 0).any():
        place = np.flatnonzero(after[wave] >= 0)
        wave = after[wave[place]]
        out.append((wave, place))
    return out
