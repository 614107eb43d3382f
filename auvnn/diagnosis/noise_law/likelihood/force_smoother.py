"""The slope of the likelihood in the law of the force, by what all windows together say of the forces.

By Fisher's identity the slope of a log likelihood whose forces are integrated out is the expected slope of the density of
the forces themselves, given all measurements: with D = -2 log p(forces; law),

    d/d law (-2 log L) = E[dD/d law | measurements].

The density of an Ornstein-Uhlenbeck force falls into factors: its value as a run begins, its value as a window begins
given the one at the end of the window before, and its means over cells and its last value given the value at the
beginning. All are Gaussian, so that second moments are enough. These come from a pass backward through the windows
(Rauch, Tung and Striebel), after that of the filter forward.

References: Segal and Weinstein (1989), IEEE Transactions on Information Theory 35(3) 682-687; Rauch, Tung and Striebel
(1965), AIAA Journal 3(8) 1445-1450.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.metrics.force_law import given_the_first

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Wave:
    """What the filter keeps of windows side by side, D = A + S + A (K + 1) variables each.

    Variables are the forces of A degrees of freedom as the window begins, the S numbers of the state there, and of each
    degree of freedom its means over K cells and its value at the end.

    Attributes:
        before: the place of each in the wave before, of the window that it follows; None in the first wave.
        begins: (n, D, 1 + P) what is expected of them before the window is seen; None in the first wave: zero.
        root: (n, A + S, A + S) root of the covariance of forces and state as windows begin, by the windows before.
        inner: (n, D, D) root of the precision of all of them once the window is seen.
        half: (n, D, 1 + P) what it moves them by, times that root's transpose.
        on: (n, A + S, D) what they make of the last forces and the last state; None where no window follows any.
        since: (n, A) what is left of the forces of the window before.
        follows: (n,) one where the state goes on, else zero; None where there is no state.
        gap: (n,) time since the window before, s.
    """

    before: Index | None
    begins: Tensor | None
    root: Tensor
    inner: Tensor
    half: Tensor
    on: Tensor | None
    since: Tensor
    follows: Tensor | None
    gap: Tensor


@dataclass(frozen=True)
class Moments:
    """Second moments of the forces, given all measurements and a law, by degree of freedom.

    Attributes:
        within: (A, K + 2, K + 2) of the value as a window begins, the means over cells and the value at the end, summed.
        count: windows.
        first: (A,) squares of the values as runs begin, summed.
        runs: how many these are.
        gone_on: (A, 3, m) square of the value as a window begins, its product with the last one before, and that one's
            square, of the m windows that follow another one.
        apart: (m,) time between the two, s.
    """

    within: Tensor
    count: int
    first: Tensor
    runs: int
    gone_on: Tensor
    apart: Tensor


def moments(waves: Sequence[Wave], follow: Tensor, cells: int) -> Moments:
    """Return the second moments of the forces by a pass backward through waves of windows.

    Args:
        waves: in the order in which the filter went through them.
        follow: (1 + P,) one, and the parameters with their sign turned, as the filter's columns are.
        cells: K.
    """
    begin = waves[0].root.shape[-1]
    count = (waves[0].inner.shape[-1] - begin) // (cells + 1)
    places = torch.tensor(
        [[k, *range(begin + k * (cells + 1), begin + (k + 1) * (cells + 1))] for k in range(count)]
    )
    within = torch.zeros(count, cells + 2, cells + 2, dtype=torch.float64)
    gone_on, apart = list[Tensor](), list[Tensor]()
    first, after_it = torch.zeros(count, dtype=torch.float64), None
    for wave in reversed(waves):
        spread = torch.cholesky_inverse(wave.inner)
        half = (wave.half @ follow)[..., None]
        mean = torch.linalg.solve_triangular(wave.inner.mT, half, upper=True).squeeze(-1)
        if wave.begins is not None:
            mean = mean + wave.begins @ follow
        if after_it is not None:
            # What the windows after these say of them comes by how these end.
            place, later = after_it
            assert later.wave.begins is not None and wave.on is not None
            there = spread[place]
            across = there @ later.passed(wave.on[place]).mT
            lever = torch.cholesky_solve(across.mT, later.wave.root).mT
            surprise = later.mean[:, :begin] - (later.wave.begins @ follow)[:, :begin]
            known = later.spread[:, :begin, :begin]
            expected = later.wave.root @ later.wave.root.mT
            mean[place] += (lever @ surprise[..., None]).squeeze(-1)
            spread[place] = there + lever @ (known - expected) @ lever.mT
            # The value at the end of each, with the one as the next begins.
            ends = places[:, -1]
            both = (lever @ known)[:, ends, torch.arange(count)]
            own, new = mean[place][:, ends], later.mean[:, :count]
            last = torch.diagonal(spread[place], dim1=1, dim2=2)[:, ends]
            next_one = torch.diagonal(known, dim1=1, dim2=2)[:, :count]
            gone_on.append(torch.stack([next_one + new**2, both + own * new, last + own**2]))
            apart.append(later.wave.gap)
        blocks = spread[:, places[:, :, None], places[:, None, :]].sum(0)
        values = mean[:, places]
        within += blocks + torch.einsum("nki,nkj->kij", values, values)
        if wave.before is None:
            first = torch.diagonal(spread, dim1=1, dim2=2)[:, :count].sum(0) + (mean[:, :count] ** 2).sum(0)
        else:
            after_it = torch.as_tensor(wave.before), _Later(wave, mean, spread)
    number = sum(len(w.inner) for w in waves)
    whole = torch.cat(gone_on, dim=1) if gone_on else torch.zeros(3, 0, count, dtype=torch.float64)
    between = torch.cat(apart) if apart else torch.zeros(0, dtype=torch.float64)
    return Moments(within, number, first, len(waves[0].inner), whole.permute(2, 0, 1), between)


@dataclass(frozen=True)
class _Later:
    """Windows that follow others, once all that comes after is known of them."""

    wave: Wave
    mean: Tensor
    spread: Tensor

    def passed(self, on: Tensor) -> Tensor:
        """Return what the variables of the windows before make of forces and states as these begin, (n, A + S, D)."""
        share = self.wave.since
        if self.wave.follows is not None:
            state = on.shape[1] - share.shape[1]
            share = torch.cat([share, self.wave.follows[:, None].expand(-1, state)], dim=1)
        return share[..., None] * on


def slope(found: Moments, rms: Array, time: Array, cells: int, cell: float) -> Array:
    """Return the slope of minus twice the log likelihood in log rms and log time, (2 A,).

    Args:
        found: moments under the same law.
        rms: (A,) of the forces, N and N m.
        time: (A,) their correlation times, s.
        cells: K.
        cell: length of the cells, s.
    """
    free = torch.tensor(np.log(np.concatenate([rms, time])), requires_grad=True)
    variance, memory = (2.0 * free[: len(rms)]).exp(), free[len(rms) :].exp()
    on, root = given_the_first(cells, cell, memory)
    # From the value with which a window begins, the means and the value at the end to what is new in these.
    same = torch.eye(cells + 1, dtype=torch.float64).expand(len(rms), -1, -1)
    new = torch.linalg.solve_triangular(root, torch.cat([-on[..., None], same], dim=-1), upper=False)
    squares = ((new @ found.within) * new).sum((1, 2)) + found.first
    log_size = 2.0 * torch.log(torch.diagonal(root, dim1=1, dim2=2)).sum(1)
    number = found.count * (cells + 1) + found.runs
    total = (squares / variance + found.count * log_size + number * torch.log(variance)).sum()
    # Where no time lies between two windows the force goes on as it is, whatever the law.
    later = found.apart > 0.0
    since = torch.exp(-found.apart[later] / memory[:, None])
    begun, both, last = found.gone_on[:, :, later].unbind(1)
    own = variance[:, None] * -torch.expm1(-2.0 * found.apart[later] / memory[:, None])
    total = total + ((begun - 2.0 * since * both + since**2 * last) / own + torch.log(own)).sum()
    (out,) = torch.autograd.grad(total, free)
    return out.numpy()
