"""How well a log determines what damping subnetworks have learned: their wrench with its standard error.

The subnetworks are linearised in their weights along the log. With residuals e_i = target_i - d_i of variance
sigma_i^2 that are correlated over f_i samples, the weights' information is

    H = sum over i of J_i^T J_i / (sigma_i^2 f_i),   and   var d(nu) = J(nu) H^-1 J(nu)^T,

so that the standard error grows where the log has not been.

Reference: Chryssolouris, Lee and Ramsey (1996), IEEE Transactions on Neural Networks 7(1), for the delta method.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.func import functional_call, jacrev, vmap

from auvnn.damping.bank import DampingBank

Array = NDArray[np.float64]
# Bytes of the Jacobian along the log: longer logs are thinned.
MOST_BYTES = 256 * 1024**2
# A residual below this share of the learned wrench is rounding, or what the form cannot bend to.
FLOOR = 1e-3
RIDGE = 1e-9
# Directions in which the slopes are this much smaller than in the largest take weights out of their first order.
REACH = 1e-4


class NetworkPosterior:
    """The wrench of damping subnetworks along a log, and how far the log determines it.

    Args:
        bank: the subnetworks.
        nu: velocity through the water (N, 6), finite.
        target: what they should give (N, 6), finite.
        run: run numbers (N,).

    Attributes:
        rows: indices of the samples that are used, (n,).
        nu: (n, 6).
        wrench: (n, 6), d(nu), N and N m.
        slope: (n, 6, P), its change with the weights.
        noise: (6,) standard deviation of the residuals, correlation included.
    """

    def __init__(self, bank: DampingBank, nu: Array, target: Array, run: NDArray[np.int64]) -> None:
        """Linearise along the log."""
        self.bank = bank
        self.names = [name for name, _ in bank.named_parameters()]
        self.size = sum(p.numel() for p in bank.parameters())
        step = max(1, int(np.ceil(len(nu) * 48 * self.size / MOST_BYTES)))
        self.rows = np.arange(0, len(nu), step)
        with torch.no_grad():
            wrench = bank(torch.as_tensor(nu).to(bank.input_scale)).double().numpy()
        self.noise = _noise(target - wrench, run, wrench) / np.sqrt(step)
        self.nu, self.wrench = nu[self.rows], wrench[self.rows]
        self.slope = self.jacobian(self.nu)
        scaled = (self.slope / self.noise[:, None]).reshape(-1, self.size)
        information = scaled.T @ scaled
        self.unit = np.sqrt(np.maximum(np.diag(information), 1e-12 * np.diag(information).max(initial=1.0)))
        information = information / self.unit[:, None] / self.unit
        self._factor = np.linalg.cholesky(information + RIDGE * np.eye(self.size))

    def jacobian(self, nu: Array) -> Array:
        """Return the change of d with the weights at velocities (n, 6): (n, 6, P)."""
        parameters = {name: p.detach() for name, p in self.bank.named_parameters()}

        def one(values: dict[str, Tensor], x: Tensor) -> Tensor:
            return functional_call(self.bank, values, (x,))

        at = torch.as_tensor(nu).to(self.bank.input_scale)
        slopes = vmap(jacrev(one), in_dims=(None, 0), chunk_size=2048)(parameters, at)
        return torch.cat([slopes[n].detach().flatten(2) for n in self.names], -1).double().numpy()

    def within_reach(self, series: Array) -> Array:
        """Return what the subnetworks could take up of wrenches along the log, (n, 6, k): the nearest they can give.

        To first order they can give what lies in the span of their slopes, each degree of freedom on its own.
        """
        out = np.zeros_like(series)
        for k in range(6):
            columns = self.slope[:, k][:, np.any(self.slope[:, k] != 0, axis=0)]
            if columns.shape[1]:
                columns = columns / np.linalg.norm(columns, axis=0)
                span, size, _ = np.linalg.svd(columns, full_matrices=False)
                span = span[:, size > REACH * size[0]]
                out[:, k] = span @ (span.T @ series[:, k])
        return out

    def covariance(self, linear: Array) -> Array:
        """Return the covariance (k, k) of k linear functions of the weights, given as rows (k, P)."""
        half = np.linalg.solve(self._factor, (linear / self.unit).T)
        return half.T @ half

    def std(self, linear: Array) -> Array:
        """Return the standard errors (...) of linear functions of the weights (..., P)."""
        rows = (linear / self.unit).reshape(-1, self.size)
        half = np.linalg.solve(self._factor, rows.T)
        return np.sqrt((half**2).sum(0)).reshape(linear.shape[:-1])

    def at(self, nu: Array) -> tuple[Array, Array]:
        """Return d and its standard error at velocities (n, 6), (n, 6) each."""
        with torch.no_grad():
            value = self.bank(torch.as_tensor(nu).to(self.bank.input_scale)).double().numpy()
        return value, self.std(self.jacobian(nu))


def _noise(residual: Array, run: NDArray[np.int64], wrench: Array) -> Array:
    """Return each residual's standard deviation times the root of the samples over which it stays alike, (6,)."""
    size = np.sqrt(np.mean(residual**2, axis=0))
    floor = FLOOR * np.sqrt(np.mean(wrench**2, axis=0))
    return np.maximum(size, np.maximum(floor, 1e-12)) * np.sqrt(correlated(residual, run))


def correlated(x: Array, run: NDArray[np.int64]) -> Array:
    """Return over how many samples each column stays alike: 1 + 2 sum of correlations until they are small, (k,)."""
    total = np.maximum(np.mean(x**2, axis=0), 1e-300)
    factor, open_ = np.ones(x.shape[1]), np.ones(x.shape[1], dtype=bool)
    for lag in range(1, min(200, len(x) // 4)):
        same = run[lag:] == run[:-lag]
        if not same.any():
            break
        value = np.mean(x[lag:][same] * x[:-lag][same], axis=0) / total
        open_ &= value > 0.05
        if not open_.any():
            break
        factor += np.where(open_, 2 * value, 0.0)
    return factor


def curves(learned: NetworkPosterior, nu: Array, points: int = 121) -> list[dict[str, object]]:
    """Return what the subnetworks make of each velocity alone, over half as much again as the log covered.

    Args:
        learned: subnetworks with their uncertainty.
        nu: velocities of the log, (N, 6), m/s and rad/s.
        points: of each curve, k.

    Returns:
        Six of {nu: (k,), learned: (k,), band: 95 % limits (2, k), low and high: the range that the log covered}.
    """
    out: list[dict[str, object]] = []
    for k in range(6):
        low, high = float(nu[:, k].min()), float(nu[:, k].max())
        reach = 1.5 * max(abs(low), abs(high), 1e-6)
        states = np.zeros((points, 6))
        states[:, k] = np.linspace(-reach, reach, points)
        value, std = (x[:, k] for x in learned.at(states))
        band = np.stack([value - 1.96 * std, value + 1.96 * std])
        out.append({"nu": states[:, k], "learned": value, "band": band, "low": low, "high": high})
    return out
