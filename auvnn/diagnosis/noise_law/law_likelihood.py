"""The likelihood of a law of the stochastic force, its forces integrated out.

In every window the force is a Gaussian vector of cells (`ForceLaw`), the initial state is free, and the sensors' noise
is white. With the windows linear about a fit, the forces can be integrated out exactly: of each window only J^T e and
J^T J are needed, and a law costs a Cholesky factor of a small matrix per window. Parameters that are free follow each
law (their profile, with their priors), so that the law need not be found again by fits. Minus twice the log likelihood is

    sum_w [c_w - b_w^T (I + L^T H_w L)^-1 b_w + log |I + L^T H_w L|],    b_w = L^T g_w,    L L^T = covariance of cells.

Reference: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, chapter 5, for the gradient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from torch import Tensor

from auvnn.diagnosis.noise_law.sums import ForceSums
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw, correlation

Array = NDArray[np.float64]
# Shares of the plausible force that are tried to begin with, and the correlation time, s.
STARTS, FIRST_TIME = np.logspace(-3.0, 1.0, 9), 1.0
# Standard deviations of the law's parameters as they are likely to be, in logarithms: a proper, weak prior.
VAGUE = 3.0


class Likelihood:
    """The likelihood of laws, of one explanation.

    Args:
        sums: of its windows.
    """

    def __init__(self, sums: ForceSums) -> None:
        """Take the parts apart."""
        self.sums, n = sums, sums.known
        statistics = sums.statistics
        keep = np.flatnonzero(sums.inside)
        self.keep = keep
        self.force = torch.as_tensor(statistics.hessian[:, n:, n:])
        self._asked: tuple[NDArray[np.int64], Tensor] | None = None
        right = np.concatenate([statistics.slope[:, n:, None], statistics.hessian[:, n:, keep]], axis=2)
        self.right = torch.as_tensor(right)
        self.theta_square = statistics.total[np.ix_(keep, keep)]
        self.theta_slope = statistics.slope[:, keep].sum(0)
        self.whole = statistics.total[:n, :n]
        self.cost = float(statistics.cost.sum())
        self.precision = sums.priors.square[np.ix_(keep, keep)]
        self.pull = sums.priors.pull(sums.theta)[keep]
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

    def of(self, law: ForceLaw | None) -> tuple[float, Array, Array, Array, Array]:
        """Return minus twice the log likelihood, step, information, expected forces, and their second moments.

        Returns:
            value; step (k,) of the parameters that can move; information (k, k) of those; forces (B, A K);
            second moments summed over windows, (A, K, K).
        """
        size = self.sums.cells
        axes = [] if law is None else law.axes
        own = np.concatenate([np.arange(size) + i * size for i in axes]) if axes else np.zeros(0, dtype=int)
        square, slope = self.theta_square, self.theta_slope
        value, count = self.cost, len(self.right)
        if law is not None and axes:
            factors = torch.as_tensor(law.factors.copy())
            right, root = self._root(own, factors, self.right)
            half = torch.linalg.solve_triangular(root, right, upper=False)
            value += float(
                2.0 * torch.log(torch.diagonal(root, dim1=-2, dim2=-1)).sum() - (half[..., 0] ** 2).sum()
            )
            along = (half[..., 1:].mT @ half).sum(0).numpy()
            square, slope = square - along[:, 1:], slope - along[:, 0]
        pull = slope - self.pull
        inverse = _inverse(square + self.precision)
        step = inverse @ pull
        value += self.prior - float(pull @ step)
        if not axes:
            return value, step, square, np.zeros((count, 0)), np.zeros((0, size, size))
        follow = torch.as_tensor(np.concatenate([[1.0], -step]))
        white = torch.cholesky_solve((right @ follow).unsqueeze(-1), root)
        mean = (factors @ white.unflatten(1, (len(axes), size))).flatten(1, 2).squeeze(-1)
        spread, blocks = torch.cholesky_inverse(root).sum(0), []
        for k in range(len(axes)):
            part = slice(k * size, (k + 1) * size)
            own_mean = mean[:, part]
            blocks.append((factors[k] @ spread[part, part] @ factors[k].mT + own_mean.mT @ own_mean).numpy())
        return value, step, square, mean.numpy(), np.stack(blocks)

    def _root(self, own: NDArray[np.int64], factors: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Return L^T times some columns, (B, A K, M), and the Cholesky factor of 1 + L^T F L, (B, A K, A K).

        L L^T is the law's covariance, which holds no product of two degrees of freedom.

        Args:
            own: rows of the force's variables in the degrees of freedom that have one, (A K,).
            factors: blocks of L, (A, K, K).
            right: columns of all variables, (B, 6 K, M).
        """
        if self._asked is None or not np.array_equal(self._asked[0], own):
            index = torch.as_tensor(own)
            self._asked = own, self.force[:, index][:, :, index]
        shape = factors.shape[:2]
        right = (factors.mT @ right[:, torch.as_tensor(own)].unflatten(1, shape)).flatten(1, 2)
        inner = (factors.mT @ self._asked[1].unflatten(1, shape)).flatten(1, 2)
        # Symmetric: the blocks of the columns as those of the rows.
        inner = (factors.mT @ inner.mT.unflatten(1, shape)).flatten(1, 2)
        torch.diagonal(inner, dim1=-2, dim2=-1).add_(1.0)
        return right, torch.linalg.cholesky(inner)

    def by_window(self, law: ForceLaw | None) -> Statistics:
        """Return the windows' sums towards the parameters, the forces of a law integrated out.

        The cost of a window is minus twice the logarithm of its likelihood, so that sums under different laws compare.
        """
        size, statistics = self.sums.cells, self.sums.statistics
        known = self.sums.known
        plain = statistics.columns(list(range(known)))
        axes = [] if law is None else law.axes
        if law is None or not axes:
            return plain
        own = np.concatenate([np.arange(size) + i * size for i in axes])
        columns = np.concatenate(
            [statistics.slope[:, known:, None], statistics.hessian[:, known:, :known]], axis=2
        )
        right, root = self._root(own, torch.as_tensor(law.factors.copy()), torch.as_tensor(columns))
        half = torch.linalg.solve_triangular(root, right, upper=False)
        along = (half.mT @ half).numpy()
        volume = 2.0 * torch.log(torch.diagonal(root, dim1=-2, dim2=-1)).sum(-1).numpy()
        return replace(
            plain,
            hessian=plain.hessian - along[:, 1:, 1:],
            slope=plain.slope - along[:, 1:, 0],
            cost=plain.cost - along[:, 0, 0] + volume,
        )

    def sloped(self, axes: Sequence[int], x: Array) -> tuple[float, Array]:
        """Return minus twice the log posterior of log rms and log time, (2 A,), and its gradient."""
        count = len(axes)
        rms, time = np.exp(x[:count]), np.exp(x[count:])
        law = self.law(axes, rms, time)
        value, _, _, _, second = self.of(law)
        windows, size = len(self.right), self.sums.cells
        slope = np.zeros(2 * count)
        for k in range(count):
            own = correlation(size, law.cell, float(time[k]))
            solved = np.linalg.solve(own, second[k]) / rms[k] ** 2
            step = 1e-4
            change = correlation(size, law.cell, float(time[k] * np.exp(step))) - correlation(
                size, law.cell, float(time[k] * np.exp(-step))
            )
            moved = np.linalg.solve(own, change / (2 * step))
            slope[k] = 2.0 * (windows * size - np.trace(solved))
            slope[count + k] = np.trace(moved @ (windows * np.eye(size) - solved))
        away = x - self._likely(axes)
        return value + float(away @ away) / VAGUE**2, slope + 2.0 * away / VAGUE**2

    def _likely(self, axes: Sequence[int]) -> Array:
        return np.concatenate([np.log(self.sums.sizes[list(axes)]), np.full(len(axes), np.log(FIRST_TIME))])

    def best(self, axes: Sequence[int], start: Array | None = None) -> tuple[float, Array]:
        """Return the smallest value with forces in some degrees of freedom, and where: log rms and log time.

        Args:
            axes: degrees of freedom.
            start: to begin from, by default the best of a few sizes.
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
        found = minimize(
            lambda x: self.sloped(axes, x), np.clip(start, low, high), jac=True, method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)), options={"maxiter": 40, "ftol": 1e-7},
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
