"""Normal equations of one tanh network with several outputs, by hand, as in `networks.py`.

All outputs share the hidden layer theta and each has its own row a_i, c_i of the output layer, which is solved for
exactly (variable projection): one Gram matrix of the units serves all outputs. The slope of output i by the weights of
unit k is a_ik g_k x, g_k = 1 - h_k^2, so that

    sum_in J_in J_in^T, block (k, l) = (sum_i a_ik a_il) sum_n g_k g_l x x^T

and no Jacobian of (outputs times samples) rows is ever built.
"""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.training.least_squares.networks import NetworkProblems, Normal
from auvnn.training.least_squares.output_layers import _ridge


class SharedProblems(NetworkProblems):
    """One network with several outputs, fitted to the mean squared residual over samples and outputs.

    Args:
        inputs: (N, p).
        targets: (N, m), scaled so that all outputs count alike.
        hidden: tanh units.
        ridge: as in `NetworkProblems`.
    """

    def __init__(self, inputs: Tensor, targets: Tensor, hidden: int, ridge: float = 1e-10) -> None:
        """Take the hidden layer of a single network, and an output layer for each target."""
        super().__init__(inputs, targets.T[:1], None, hidden, ridge=ridge)
        self.targets, self.outputs = targets, targets.shape[1]
        self.outer_size = self.outputs * (hidden + 1)
        self.total = targets.new_full((1,), float(targets.numel()))

    def _units(self, theta: Tensor, part: slice) -> Tensor:
        """Return units and ones (B, h + 1, n)."""
        hidden = self._hidden(theta, part)
        return torch.cat([hidden, torch.ones_like(hidden[:, :1])], 1)

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return the best output layers (B, m (h + 1)), output by output, and the cost (B,)."""
        count, q = len(theta), self.hidden + 1
        gram, right = theta.new_zeros(count, q, q), theta.new_zeros(count, q, self.outputs)
        for part in self._chunks(count):
            basis = self._units(theta, part)
            gram.baddbmm_(basis, basis.mT)
            right += basis @ self.targets[part]
        factor, _ = torch.linalg.cholesky_ex(gram + _ridge(gram, self.ridge))
        beta = torch.cholesky_solve(right, factor)
        beta = beta + torch.cholesky_solve(right - gram @ beta, factor)
        flat = beta.mT.reshape(count, self.outer_size)
        return flat, self.cost(theta, flat, member)

    def cost(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the mean of the squared residual (B,)."""
        total, rows = theta.new_zeros(len(theta)), beta.view(len(beta), self.outputs, -1)
        for part in self._chunks(len(theta)):
            residual = rows @ self._units(theta, part) - self.targets[part].T
            total += residual.square().sum((1, 2))
        return total / self.total[0]

    def normal(self, theta: Tensor, beta: Tensor, member: Tensor) -> Normal:
        """Return the normal equations at (theta, beta); see the head of this file."""
        count, h, m, p = len(theta), self.hidden, self.outputs, self.x.shape[1]
        rows = beta.view(count, m, h + 1)
        first, second = self._pairs_of_units
        left, right = self._pairs
        squares = theta.new_zeros(count * len(first), len(left))
        mixed = theta.new_zeros(count * h * (h + 2), p)
        gram, outer_slope = theta.new_zeros(count, h + 1, h + 1), theta.new_zeros(count, m, h + 1)
        for part in self._chunks(count):
            x, units = self.x[part], self._units(theta, part)
            hidden = units[:, :h]
            slope = 1.0 - hidden * hidden
            residual = rows @ units - self.targets[part].T
            pairs = x[:, left] * x[:, right] if self._squares is None else self._squares[part]
            squares.addmm_((slope[:, first] * slope[:, second]).view(-1, x.shape[0]), pairs)
            # What unit k multiplies: the units and ones, and the residuals as it carries them to its output rows.
            carried = rows[..., :h].mT @ residual
            series = torch.cat([units[:, None].expand(-1, h, -1, -1), carried[:, :, None]], 2)
            mixed.addmm_((slope[:, :, None] * series).reshape(-1, x.shape[0]), x)
            gram.baddbmm_(units, units.mT)
            outer_slope.baddbmm_(residual, units.mT)
        weight = rows[..., :h].mT @ rows[..., :h]  # (B, h, h)
        products = squares.view(count, len(first), len(left)) * weight[:, first, second][..., None]
        block = theta.new_empty(count, len(first), p, p)
        block[:, :, left, right] = products
        block[:, :, right, left] = products
        inner = theta.new_empty(count, h, p, h, p)
        inner[:, first, :, second] = block.transpose(0, 1)
        inner[:, second, :, first] = block.mT.transpose(0, 1)
        crossed = mixed.view(count, h, h + 2, p).transpose(2, 3)  # (B, h, p, h + 2)
        cross = torch.einsum("bik,bkpl->bkpil", rows[..., :h], crossed[..., : h + 1])
        outer = theta.new_zeros(count, m, h + 1, m, h + 1)
        for i in range(m):
            outer[:, i, :, i] = gram
        return Normal(
            inner.reshape(count, h * p, h * p),
            cross.reshape(count, h * p, self.outer_size),
            outer.view(count, self.outer_size, self.outer_size),
            crossed[..., h + 1].reshape(count, h * p),
            outer_slope.view(count, self.outer_size),
        )
