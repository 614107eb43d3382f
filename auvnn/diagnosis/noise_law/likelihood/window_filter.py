"""Windows one after the other, conditional on those before them: states and forces of a law integrated out.

In every window the force is a Gaussian vector: its means over cells (`ForceLaw`), and its value at the end. The next
window of the run depends on what was before by that value and, where it begins with the sample with which this one ends,
by the last state s = E v + d, with v the initial state and the force, of which E is the linear map to the end. So
windows count as conditional on their past, as one filter through the whole run would have it (up to chains of ten
windows): a slow force is not taken for as many independent ones as there are windows, and commands that answer the force
are conditional on it.

The force as a window begins, f0, is a variable of its own: given it, the means over cells and the value at the end are
Gaussian with mean G f0 and the covariance C of a process that begins at a known value, the same in all windows. With P
the covariance of f0 and the initial state, from what is known of the window before, all of them have the precision

    Q = [[P^-1 + G^T C^-1 G, -G^T C^-1], [-C^-1 G, C^-1]]

(G with zeros for the state). With mu their mean, minus twice the log likelihood of a window is

    c - 2 g^T mu + mu^T H mu - b^T (Q + H)^-1 b + log |Q + H| + log |P| + log |C|,    b = g - H mu.

Where windows are linear about free running, states are free in every window and the force alone goes on.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237, for likelihoods conditional on the past.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import pad

from auvnn.diagnosis.noise_law.likelihood.force_smoother import Wave
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.estimation.force_marginalisation.sums import LOOSE
from auvnn.metrics.force_law import given_the_first

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
            # A step that led far away has sums that overflow: no likelihood follows from them, and it is not taken.
            with np.errstate(over="ignore", invalid="ignore"):
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
        self.loose = [torch.diag(torch.as_tensor(LOOSE**2.0))] if states is not None else []
        if states is not None:
            self.offset = torch.as_tensor(states.offset)
            self.follows = torch.as_tensor(states.follows.astype(float))

    def windows(
        self, axes: Sequence[int], rms: Tensor, time: Tensor, kept: list[Wave] | None = None
    ) -> Iterator[tuple[Index, Tensor, Tensor]]:
        """Yield windows, their squares (n, 1 + P, 1 + P), forces and states integrated out, and log determinants (n,).

        Args:
            axes: degrees of freedom with a force.
            rms: of each of them, (A,).
            time: of each of them, (A,), s.
            kept: to which what a pass backward needs is appended.
        """
        size, count, free = self.sums.cells, len(axes), self.free
        if self._asked is None or self._asked[0] != tuple(axes):
            self._asked = tuple(axes), *self._of_axes(axes)
        index, force, ends = self._asked[1:]
        columns = self.columns[:, index] * (index >= 0)[:, None]
        prior = self._within(rms, time)
        begun = torch.linalg.cholesky(_blocks([torch.diag(rms**2), *self.loose]))
        # What goes on to the next window: the force's last values, and the last state.
        last = torch.zeros(count, len(index), dtype=torch.float64)
        last[torch.arange(count), free + torch.arange(1, count + 1) * (size + 1) - 1] = 1.0
        mean = spread = None
        for where, before in self.waves:
            here = torch.as_tensor(where)
            h, g, square = force[here], columns[here], self.plain[here]
            if before is None or mean is None or spread is None:
                begins, root = None, begun.expand(len(where), -1, -1)
            else:
                begins, root = self._begins(here, mean[before], spread[before], rms, time)
                within = torch.cat([begins[:, count:], prior.onto @ begins[:, :count]], dim=1)
                cross = g.mT @ within
                square = square - cross - cross.mT + within.mT @ h @ within
                g = g - h @ within
                begins = torch.cat([begins, within[:, free:]], dim=1)
            # No measurement shows the force as the window begins, but for what it makes likely within.
            inner = torch.linalg.cholesky(prior.precision(root) + pad(h, (count, 0, count, 0)))
            half = torch.linalg.solve_triangular(inner, pad(g, (0, 0, count, 0)), upper=False)
            yield where, square - half.mT @ half, prior.volume + _volume(root) + _volume(inner)
            on = None
            if len(self.waves) > 1:
                on = pad(torch.cat([last.expand(len(where), -1, -1), ends[here]], dim=1), (count, 0))
                known = torch.linalg.solve_triangular(inner, on.mT, upper=False)
                mean, spread = known.mT @ half, known.mT @ known
                if begins is not None:
                    mean = mean + on @ begins
                if free:
                    mean = torch.cat([mean[:, :count], mean[:, count:] + self.led[here]], dim=1)
            if kept is not None:
                since = torch.exp(-self.gap[here, None] / time)
                follows = self.follows[here] if free else None
                kept.append(Wave(before, begins, root, inner, half, on, since, follows, self.gap[here]))

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

    def _within(self, rms: Tensor, time: Tensor) -> Within:
        """Return what the forces as a window begins make of those within it.

        Args:
            rms: of each degree of freedom with a force, (A,).
            time: of each of them, (A,), s.
        """
        size, cell = self.sums.cells, self.sums.cell
        on, root = given_the_first(size, cell, time)
        inverse = torch.cholesky_inverse(root) / rms[:, None, None] ** 2
        volume = _volume(root).sum() + 2.0 * (size + 1) * torch.log(rms).sum()
        return Within(_blocks([*on[..., None]]), _blocks([*inverse]), volume)

    def _begins(
        self, here: Tensor, mean: Tensor, spread: Tensor, rms: Tensor, time: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return what is expected of forces and states as windows begin, (n, A + S, 1 + P), and their covariance's root.

        Args:
            here: the windows.
            mean: of the last forces and states of the windows that they follow, (n, A + S, 1 + P).
            spread: their covariance.
            rms: of each degree of freedom with a force, (A,).
            time: of each of them, (A,), s.
        """
        count = len(rms)
        since = torch.exp(-self.gap[here, None] / time)[..., None]
        force = since * mean[:, :count]
        covariance = since * spread[:, :count, :count] * since.mT + torch.diag_embed(
            rms**2 * (1.0 - since[..., 0] ** 2)
        )
        if not self.free:
            return force, torch.linalg.cholesky(covariance)
        follows = self.follows[here, None, None]
        state = mean[:, count:] * follows
        offset = torch.zeros_like(state)
        offset[..., :1] = (self.offset[here, :, None] * follows)[..., :1]
        across = since * spread[:, :count, count:] * follows
        own = (
            follows * (spread[:, count:, count:] + LEAST**2 * self.loose[0]) + (1.0 - follows) * self.loose[0]
        )
        whole = torch.cat(
            [torch.cat([covariance, across], dim=-1), torch.cat([across.mT, own], dim=-1)], dim=1
        )
        return torch.cat([force, state + offset], dim=1), torch.linalg.cholesky(whole)


@dataclass(frozen=True)
class Within:
    """What forces as a window begins make of those within it: of means over cells and, last, the value at the end.

    Attributes:
        onto: (A (K + 1), A) what they are expected to be, by the forces as the window begins.
        inverse: (A (K + 1), A (K + 1)) of their covariance, given these.
        volume: logarithm of its determinant.
    """

    onto: Tensor
    inverse: Tensor
    volume: Tensor

    def precision(self, root: Tensor) -> Tensor:
        """Return the precision of the forces as windows begin, the states there, and the forces within.

        Args:
            root: of the covariance of forces and states as windows begin, (n, A + S, A + S).
        """
        free = root.shape[-1] - self.onto.shape[1]
        aside = -self.inverse @ self.onto
        own = pad(-self.onto.mT @ aside, (0, free, 0, free))
        back = pad(aside, (0, free)).expand(len(root), -1, -1)
        inside = self.inverse.expand(len(root), -1, -1)
        first = torch.cholesky_inverse(root) + own
        return torch.cat([torch.cat([first, back.mT], dim=-1), torch.cat([back, inside], dim=-1)], dim=1)


def _volume(root: Tensor) -> Tensor:
    """Return the logarithm of the determinant of matrices by their Cholesky factors."""
    return 2.0 * torch.log(torch.diagonal(root, dim1=-2, dim2=-1)).sum(-1)


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
