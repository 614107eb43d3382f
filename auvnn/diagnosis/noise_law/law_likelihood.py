"""The likelihood of a law of the stochastic force, its forces integrated out.

In every window the force is a Gaussian vector of cells (`ForceLaw`), the initial state is free, and the sensors' noise
is white. With the windows linear about a fit, the forces can be integrated out exactly: of each window only J^T e and
J^T J are needed, and a law costs a Cholesky factor of a small matrix per window. Parameters that are free follow each
law (their profile, with their priors), so that the law need not be found again by fits.

Windows that follow one another are filtered: the force of a window is expected from its last cell in the window before,
as far as that is known from there (mean m and covariance P of that cell, C_0 its variance, G the regression on it),

    f ~ N(G m, C + G (P - C_0) G^T),

so that windows count as conditional on their past: a slow force is not taken for as many independent ones as there are
windows, and commands that answer it are conditional on it. With L L^T the covariance and mu the mean, minus twice the
log likelihood of a window is

    c - 2 g^T mu + mu^T H mu - b^T (I + L^T H L)^-1 b + log |I + L^T H L|,    b = L^T (g - H mu).

References: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, chapter 5; Kristensen, Madsen and
Joergensen (2004), Automatica 40(2) 225-237, for likelihoods conditional on the past.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from torch import Tensor

from auvnn.diagnosis.noise_law.sums import ForceSums
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw, covariance_of_means

Array = NDArray[np.float64]
Index = NDArray[np.int64]
# Shares of the plausible force that are tried to begin with, and the correlation time, s.
STARTS, FIRST_TIME = np.logspace(-3.0, 1.0, 9), 1.0
# Standard deviations of the law's parameters as they are likely to be, in logarithms: a proper, weak prior.
VAGUE = 3.0
# Steps of the search for the likeliest law.
STEPS = 40


class Likelihood:
    """The likelihood of laws, of one explanation.

    Args:
        sums: of its windows.
    """

    def __init__(self, sums: ForceSums) -> None:
        """Take the parts apart."""
        self.sums, n = sums, sums.known
        statistics = sums.statistics
        self.keep = np.flatnonzero(sums.inside)
        self.force = torch.as_tensor(statistics.hessian[:, n:, n:])
        # Columns of the errors, then of the parameters with their sign turned: error - J theta.
        own = np.concatenate([statistics.slope[:, n:, None], statistics.hessian[:, n:, :n]], axis=2)
        self.columns = torch.as_tensor(own)
        plain = np.empty((len(own), 1 + n, 1 + n))
        plain[:, 0, 0], plain[:, 1:, 1:] = statistics.cost, statistics.hessian[:, :n, :n]
        plain[:, 0, 1:] = plain[:, 1:, 0] = statistics.slope[:, :n]
        self.plain = torch.as_tensor(plain)
        self._asked: tuple[tuple[int, ...], Tensor] | None = None
        before = np.full(len(own), -1) if sums.before is None else sums.before
        self.waves = _waves(before)
        self.gap = torch.as_tensor(np.zeros(len(own)) if sums.gap is None else sums.gap)
        self.precision = sums.priors.square[np.ix_(self.keep, self.keep)]
        self.pull = sums.priors.pull(sums.theta)[self.keep]
        self.prior = sums.priors.penalty(sums.theta) if len(sums.theta) else 0.0

    def shown(self) -> list[int]:
        """Return the degrees of freedom in which a force would move anything that is measured.

        In a vertical plane with a measured attitude two of six do: of the others every likelihood ratio is one.
        """
        seen = torch.diagonal(self.force, dim1=-2, dim2=-1).sum(0).reshape(6, self.sums.cells).sum(-1)
        return [int(i) for i in np.flatnonzero(seen.numpy() > 0.0)]

    def law(self, axes: Sequence[int], rms: Array, time: Array) -> ForceLaw:
        """Return a law with forces in some degrees of freedom.

        Args:
            axes: degrees of freedom with a force, 0 to 5.
            rms: of each of them, N and N m.
            time: correlation time of each of them, s.
        """
        full, times = np.zeros(6), np.ones(6)
        full[list(axes)], times[list(axes)] = rms, time
        return ForceLaw(full, times, self.sums.cell, self.sums.span)

    def of(self, law: ForceLaw | None) -> tuple[float, Array, Array, float]:
        """Return minus twice the log likelihood, step, information, and what the step takes away of the value.

        Returns:
            value; step (k,) of the parameters that can move; information (k, k) of those; gain.
        """
        value, whole = self._whole(law)
        step, square, pull = self._followed(whole)
        gain = float(pull @ step)
        return value + float(whole[0, 0]) + self.prior - gain, step, square, gain

    def by_window(self, law: ForceLaw | None) -> Statistics:
        """Return the windows' sums towards the parameters, the forces of a law integrated out.

        The cost of a window is minus twice the logarithm of its likelihood, conditional on the windows before it, so that
        sums under different laws compare.
        """
        known = self.sums.known
        plain = self.sums.statistics.columns(list(range(known)))
        if law is None or not law.axes:
            return plain
        hessian, slope, cost = plain.hessian.copy(), plain.slope.copy(), plain.cost.copy()
        for where, square, volume in self._windows(law.axes, *_of(law), self.columns, self.plain):
            hessian[where], slope[where] = square[:, 1:, 1:].numpy(), square[:, 0, 1:].numpy()
            cost[where] = (square[:, 0, 0] + volume).numpy()
        return replace(plain, hessian=hessian, slope=slope, cost=cost)

    def _whole(self, law: ForceLaw | None) -> tuple[float, Array]:
        """Return the sum of the log determinants, and that of the squares, (1 + P, 1 + P)."""
        if law is None or not law.axes:
            return 0.0, self.plain.sum(0).numpy()
        whole, value = torch.zeros_like(self.plain[0]), 0.0
        for _, square, volume in self._windows(law.axes, *_of(law), self.columns, self.plain):
            whole, value = whole + square.sum(0), value + float(volume.sum())
        return value, whole.numpy()

    def _followed(self, whole: Array) -> tuple[Array, Array, Array]:
        """Return how the parameters that can move follow a law, their information, and their slope."""
        own = 1 + self.keep
        square, pull = whole[np.ix_(own, own)], whole[own, 0] - self.pull
        return _inverse(square + self.precision) @ pull, square, pull

    def _windows(
        self, axes: Sequence[int], rms: Tensor, time: Tensor, columns: Tensor, plain: Tensor
    ) -> Iterator[tuple[Index, Tensor, Tensor]]:
        """Yield windows, their squares (n, M, M) with the forces integrated out, and log determinants (n,).

        Args:
            axes: degrees of freedom with a force.
            rms: of each of them, (A,).
            time: of each of them, (A,), s.
            columns: J^T times errors and the like, of all variables of the force, (B, 6 K, M).
            plain: their squares without a force, (B, M, M).
        """
        size, count = self.sums.cells, len(axes)
        index = torch.as_tensor(np.concatenate([np.arange(size) + i * size for i in axes]))
        if self._asked is None or self._asked[0] != tuple(axes):
            self._asked = tuple(axes), self.force[:, index][:, :, index]
        force, columns = self._asked[1], columns[:, index]
        # The last cell of the window before, and the window's own.
        joint = [rms[k] ** 2 * covariance_of_means(size + 1, self.sums.cell, time[k]) for k in range(count)]
        own = torch.block_diag(*[c[1:, 1:] for c in joint])
        onto = torch.block_diag(*[c[1:, :1] / c[0, 0] for c in joint])
        variance = torch.diag(torch.stack([c[0, 0] for c in joint]))
        last = torch.as_tensor([k * size + size - 1 for k in range(count)])
        eye = torch.eye(count * size, dtype=torch.float64)
        mean = spread = None
        for where, before in self.waves:
            here = torch.as_tensor(where)
            h, g = force[here], columns[here]
            if before is None or mean is None or spread is None:
                expected, root = None, torch.linalg.cholesky(own).expand(len(where), -1, -1)
            else:
                since = torch.exp(-self.gap[here, None] / time).repeat_interleave(size, dim=1)
                regression = onto * since[..., None]
                expected = regression @ mean[before]
                root = torch.linalg.cholesky(own + regression @ (spread[before] - variance) @ regression.mT)
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
                known = torch.linalg.solve_triangular(inner, root[:, last].mT, upper=False)
                mean, spread = known.mT @ half, known.mT @ known
                if expected is not None:
                    mean = mean + expected[:, last]

    def sloped(self, axes: Sequence[int], x: Array) -> tuple[float, Array]:
        """Return minus twice the log posterior of log rms and log time, (2 A,), and its gradient.

        At the parameters that follow a law the slope in them is zero: they are held while the law's is taken.
        """
        count = len(axes)
        law = self.law(axes, np.exp(x[:count]), np.exp(x[count:]))
        value, whole = self._whole(law)
        step, _, pull = self._followed(whole)
        follow = np.zeros(len(whole))
        follow[0], follow[1 + self.keep] = 1.0, -step
        along = torch.as_tensor(follow)[:, None]
        free = torch.tensor(x, requires_grad=True)
        parts = self._windows(
            axes, free[:count].exp(), free[count:].exp(), self.columns @ along, along.mT @ self.plain @ along
        )
        total = torch.stack([square.sum() + volume.sum() for _, square, volume in parts]).sum()
        (slope,) = torch.autograd.grad(total, free)
        away = x - self._likely(axes)
        value += float(whole[0, 0]) + self.prior - float(pull @ step)
        return value + float(away @ away) / VAGUE**2, slope.numpy() + 2.0 * away / VAGUE**2

    def _likely(self, axes: Sequence[int]) -> Array:
        return np.concatenate([np.log(self.sums.sizes[list(axes)]), np.full(len(axes), np.log(FIRST_TIME))])

    def best(self, axes: Sequence[int], start: Array | None = None, most: int = STEPS) -> tuple[float, Array]:
        """Return the smallest value with forces in some degrees of freedom, and where: log rms and log time.

        Args:
            axes: degrees of freedom.
            start: to begin from, by default the best of a few sizes.
            most: steps of the search; with none the value is that of the start.
        """
        axes = list(axes)
        low = np.concatenate(
            [np.log(1e-4 * self.sums.sizes[axes]), np.full(len(axes), np.log(self.sums.times[0]))]
        )
        high = np.concatenate(
            [np.log(1e2 * self.sums.sizes[axes]), np.full(len(axes), np.log(self.sums.times[1]))]
        )
        if start is None:
            start = self._start(axes)
        if most == 0:
            count = len(axes)
            return self.of(self.law(axes, np.exp(start[:count]), np.exp(start[count:])))[0], start
        found = minimize(
            lambda x: self.sloped(axes, x), np.clip(start, low, high), jac=True, method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)), options={"maxiter": most, "ftol": 1e-7},
        )  # fmt: skip
        return float(found.fun), np.asarray(found.x)

    def _start(self, axes: list[int]) -> Array:
        """Return the best of a few sizes, one degree of freedom after the other."""
        time = float(np.clip(FIRST_TIME, *self.sums.times))
        sizes: dict[int, float] = {}
        for i in axes:
            tried = {}
            for share in STARTS:
                trial = {**sizes, i: share * self.sums.sizes[i]}
                order = sorted(trial)
                law = self.law(order, np.array([trial[k] for k in order]), np.full(len(order), time))
                tried[share] = self.of(law)[0]
            sizes[i] = min(tried, key=lambda s: tried[s]) * self.sums.sizes[i]
        return np.concatenate([np.log([sizes[i] for i in axes]), np.full(len(axes), np.log(time))])


def _inverse(square: Array) -> Array:
    if not len(square):
        return square
    unit = 1.0 / np.sqrt(np.maximum(np.diag(square), 1e-300))
    return np.linalg.pinv(square * unit[:, None] * unit, hermitian=True) * unit[:, None] * unit


def _of(law: ForceLaw) -> tuple[Tensor, Tensor]:
    return torch.as_tensor(law.rms[law.axes]), torch.as_tensor(law.time[law.axes])


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
