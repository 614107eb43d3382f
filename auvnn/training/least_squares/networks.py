"""Normal equations of many small tanh networks at once, by hand: no Jacobian is ever stored.

A network's output is linear in its output layer, so a problem here has inner parameters theta (the hidden
layer) and outer ones beta (the output layer), which are solved for exactly whenever theta changes (variable
projection). The normal matrix of the hidden layer is built from products: with g_k = a_k (1 - h_k^2) and
inputs x with a 1 appended, its block (k, l) is sum_n g_k g_l x x^T, so one product of the h(h+1)/2 series
g_k g_l with the 91 series x_i x_j, which all networks share, gives all blocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from auvnn.training.least_squares.output_layers import RIDGE, _at_rest, draw_units, output_layers

KEPT_BYTES = 64 * 1024**2


@dataclass
class Normal:
    """Normal equations of B problems: Q inner, q outer parameters."""

    inner: Tensor  # (B, Q, Q) J_theta^T J_theta
    cross: Tensor  # (B, Q, q)
    outer: Tensor  # (B, q, q)
    inner_slope: Tensor  # (B, Q) J_theta^T r
    outer_slope: Tensor  # (B, q)

    def tensors(self) -> tuple[Tensor, ...]:
        """Return the five tensors in the order of the fields."""
        return self.inner, self.cross, self.outer, self.inner_slope, self.outer_slope

    def __add__(self, other: Normal) -> Normal:
        """Return the normal equations of the samples of both."""
        return Normal(*(a + b for a, b in zip(self.tensors(), other.tensors(), strict=True)))


class Problems(Protocol):
    """Several least-squares problems over the same inputs, told apart by their member number."""

    members: int
    inner_size: int
    outer_size: int
    total: Tensor  # (members,) sum of the weights

    def draw(self, generator: torch.Generator) -> Tensor:
        """Return initial inner parameters (members, Q)."""
        ...

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return the best outer parameters (B, q) for theta (B, Q), and the cost (B,)."""
        ...

    def cost(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted mean of the squared residual (B,).

        Args:
            theta: parameters of B fits, (B, P).
            beta: their output layers, (B, q).
            member: degree of freedom that each fit is for, (B,).
        """
        ...

    def normal(self, theta: Tensor, beta: Tensor, member: Tensor) -> Normal:
        """Return the normal equations at (theta, beta).

        Args:
            theta: parameters of B fits, (B, P).
            beta: their output layers, (B, q).
            member: degree of freedom that each fit is for, (B,).
        """
        ...


class NetworkProblems:
    """Tanh networks with one linear output, each fitted to its own target on shared inputs.

    Args:
        inputs: (N, p).
        targets: (m, N), one row per network.
        weights: (m, N) of the squared residuals, or None for ones.
        hidden: tanh units of each network.
        zero_at_rest: the networks subtract their value at x = 0 and have no output bias.
        ridge: relative to the diagonal, keeps collinear hidden units from taking huge opposite weights.
        first: number of the first sample, where these are some of many.
    """

    def __init__(
        self,
        inputs: Tensor,
        targets: Tensor,
        weights: Tensor | None,
        hidden: int,
        zero_at_rest: bool = False,
        ridge: float = RIDGE,
        first: int = 0,
    ) -> None:
        """Precompute the products of the inputs that all networks share."""
        samples, p = inputs.shape
        self.x = torch.cat([inputs, torch.ones_like(inputs[:, :1])], 1)
        self.y, self.w = targets, weights
        self.total = targets.new_full((len(targets),), float(samples)) if weights is None else weights.sum(1)
        self.members, self.hidden, self.rest, self.ridge = len(targets), hidden, zero_at_rest, ridge
        self.inner_size, self.first = hidden * (p + 1), first
        self.outer_size = hidden + (0 if zero_at_rest else 1)
        self._pairs = torch.triu_indices(p + 1, p + 1)
        self._pairs_of_units = torch.triu_indices(hidden, hidden)
        small = samples * self._pairs.shape[1] * inputs.element_size() <= KEPT_BYTES
        self._squares = self.x[:, self._pairs[0]] * self.x[:, self._pairs[1]] if small else None

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw hidden layers that bend where the data is.

        Directions are drawn at random and scaled so that the argument of tanh has standard deviation 1/2 over
        the data; the bias puts each unit's centre on a sample. (Nguyen and Widrow's idea, with the data's own
        spread in place of a box: on a manoeuvre the samples lie near a curve.)
        """
        mean = self.x[:, :-1].mean(0)
        covariance = self.scatter(mean) / len(self.x)
        return draw_units(self.members, self.hidden, len(self.x), mean, covariance, self.inputs_at, generator)

    def inputs_sum(self) -> Tensor:
        """Return the sum of the inputs, (p,)."""
        return self.x[:, :-1].sum(0)

    def scatter(self, mean: Tensor) -> Tensor:
        """Return the sum of products of the inputs about a mean, (p, p)."""
        centred = self.x[:, :-1] - mean
        return centred.T @ centred

    def inputs_at(self, rows: Tensor) -> Tensor:
        """Return the inputs of some samples by their numbers, (..., p); zeros for those that are not here."""
        here = rows - self.first
        known = (here >= 0) & (here < len(self.x))
        return torch.where(known[..., None], self.x[here.clamp(0, len(self.x) - 1)][..., :-1], 0.0)

    def _chunks(self, problems: int) -> Iterator[slice]:
        # Blocks that stay in the cache: 3 times faster than whole columns for a few hundred networks.
        size = max(128, min(1024, 6144 // max(problems, 1)))
        for start in range(0, len(self.x), size):
            yield slice(start, start + size)

    def _hidden(self, theta: Tensor, part: slice) -> Tensor:
        units = theta.reshape(-1, self.x.shape[1]) @ self.x[part].T
        return torch.tanh(units).view(len(theta), self.hidden, -1)

    def _rest(self, theta: Tensor) -> Tensor:
        return torch.tanh(theta.view(len(theta), self.hidden, -1)[..., -1])

    def _series(self, theta: Tensor, hidden: Tensor) -> Tensor:
        """Return units, ones and a free last row (B, h + 2, n); the first q rows are what beta multiplies."""
        series = hidden.new_empty(len(hidden), self.hidden + 2, hidden.shape[-1])
        series[:, : self.hidden] = hidden
        if self.rest:
            series[:, : self.hidden] -= self._rest(theta)[..., None]
        series[:, self.hidden] = 1.0
        return series

    def _basis(self, theta: Tensor, part: slice) -> Tensor:
        """Return what the outer parameters multiply (B, q, n)."""
        return self._series(theta, self._hidden(theta, part))[:, : self.outer_size]

    def _weighted(self, series: Tensor, member: Tensor, part: slice) -> Tensor:
        return series if self.w is None else series * self.w[member, part][:, None]

    def _residual(self, basis: Tensor, beta: Tensor, member: Tensor, part: slice) -> Tensor:
        return torch.baddbmm(-self.y[member, part][:, None], beta[:, None], basis)

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return the best output layers (B, q) for given hidden layers, and the cost (B,)."""
        keep = len(theta) * self.outer_size * len(self.x) * theta.element_size() <= KEPT_BYTES
        kept: list[Tensor] = []
        gram, right = self.gram(theta, member, kept if keep else None)
        beta = output_layers(gram, right, self.ridge)
        return beta, self._squares_of(theta, beta, member, kept) / self.total[member]

    def gram(self, theta: Tensor, member: Tensor, kept: list[Tensor] | None = None) -> tuple[Tensor, Tensor]:
        """Return the sums that decide on the output layers, (B, q, q) and (B, q, 1).

        Args:
            theta: (B, Q).
            member: (B,).
            kept: takes what the output layers multiply, for whoever needs it again.
        """
        count, q = len(theta), self.outer_size
        gram, right = theta.new_zeros(count, q, q), theta.new_zeros(count, q, 1)
        for part in self._chunks(count):
            basis = self._basis(theta, part)
            weighted = self._weighted(basis, member, part)
            gram.baddbmm_(weighted, basis.mT)
            right.baddbmm_(weighted, self.y[member, part][..., None])
            if kept is not None:
                kept.append(basis)
        return gram, right

    def cost(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted mean of the squared residual (B,).

        Args:
            theta: parameters of B fits, (B, P).
            beta: their output layers, (B, q).
            member: degree of freedom that each fit is for, (B,).
        """
        return self.squares(theta, beta, member) / self.total[member]

    def squares(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted sum of the squared residual (B,).

        Args:
            theta: parameters of B fits, (B, P).
            beta: their output layers, (B, q).
            member: degree of freedom that each fit is for, (B,).
        """
        return self._squares_of(theta, beta, member, [])

    def _squares_of(self, theta: Tensor, beta: Tensor, member: Tensor, kept: list[Tensor]) -> Tensor:
        total = theta.new_zeros(len(theta))
        for number, part in enumerate(self._chunks(len(theta))):
            basis = kept[number] if kept else self._basis(theta, part)
            residual = self._residual(basis, beta, member, part)
            total += (self._weighted(residual, member, part) @ residual.mT)[:, 0, 0]
        return total

    def normal(self, theta: Tensor, beta: Tensor, member: Tensor) -> Normal:
        """Return the normal equations at (theta, beta); see the head of this file.

        Args:
            theta: parameters of B fits, (B, P).
            beta: their output layers, (B, q).
            member: degree of freedom that each fit is for, (B,).
        """
        count, h, p = len(theta), self.hidden, self.x.shape[1]
        first, second = self._pairs_of_units
        left, right = self._pairs
        squares = theta.new_zeros(count * len(first), len(left))
        mixed = theta.new_zeros(count * h * (h + 2), p)
        plain = theta.new_zeros(count, h + 2, h + 2)
        scale = beta[:, :h, None]
        for part in self._chunks(count):
            x, hidden = self.x[part], self._hidden(theta, part)
            slope = (1.0 - hidden * hidden) * scale
            series = self._series(theta, hidden)
            series[:, h + 1 :] = self._residual(series[:, : self.outer_size], beta, member, part)
            weighted = self._weighted(series, member, part)
            product = self._weighted(slope[:, first] * slope[:, second], member, part)
            pairs = x[:, left] * x[:, right] if self._squares is None else self._squares[part]
            squares.addmm_(product.view(-1, x.shape[0]), pairs)
            mixed.addmm_((slope[:, :, None] * weighted[:, None]).view(-1, x.shape[0]), x)
            plain.baddbmm_(weighted, series.mT)
        block = theta.new_empty(count, len(first), p, p)
        squares = squares.view(count, len(first), len(left))
        block[:, :, left, right] = squares
        block[:, :, right, left] = squares
        inner = theta.new_empty(count, h, p, h, p)
        inner[:, first, :, second] = block.transpose(0, 1)
        inner[:, second, :, first] = block.mT.transpose(0, 1)
        cross = mixed.view(count, h, h + 2, p).transpose(2, 3)  # (B, h, p, h + 2)
        if self.rest:
            inner, cross = _at_rest(inner, cross, plain, (1.0 - self._rest(theta).square()) * beta)
        q = self.outer_size
        wide = cross.reshape(count, h * p, h + 2)
        return Normal(
            inner.reshape(count, h * p, h * p),
            wide[..., :q].contiguous(),
            plain[:, :q, :q].contiguous(),
            wide[..., h + 1].contiguous(),
            plain[:, :q, h + 1].contiguous(),
        )
