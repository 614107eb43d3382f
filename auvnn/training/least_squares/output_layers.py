"""Output layers of networks: the linear least squares that end every step, and the units from which a fit begins."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

RIDGE = 1e-10


def draw_units(
    members: int,
    hidden: int,
    samples: int,
    mean: Tensor,
    covariance: Tensor,
    inputs_at: Callable[[Tensor], Tensor],
    generator: torch.Generator,
) -> Tensor:
    """Return hidden layers (members, Q) as `NetworkProblems.draw` describes them.

    Args:
        members: networks.
        hidden: units of each.
        samples: how many there are.
        mean: of the inputs, (p,).
        covariance: of the inputs, (p, p).
        inputs_at: gives the inputs of some samples.
        generator: draws.
    """
    shape = (members, hidden)
    weight = torch.randn((*shape, len(mean)), generator=generator, dtype=torch.float64)
    rows = torch.randint(samples, shape, generator=generator)
    spread = ((weight @ covariance) * weight).sum(-1, keepdim=True).clamp_min(0).sqrt()
    weight = 0.5 * weight / spread.clamp_min(1e-6)
    bias = -(inputs_at(rows) * weight).sum(-1, keepdim=True)
    return torch.cat([weight, bias], -1).reshape(members, -1)


def output_layers(gram: Tensor, right: Tensor, ridge: float) -> Tensor:
    """Return the output layers (B, q) that solve the normal equations of (B, q, q) and (B, q, 1).

    Args:
        gram: of the units, (B, q, q).
        right: of units and targets, (B, q, 1).
        ridge: relative to the mean of the diagonal.
    """
    factor, _ = torch.linalg.cholesky_ex(gram + _ridge(gram, ridge))
    beta = torch.cholesky_solve(right, factor)
    # One step of refinement takes most of the ridge's bias away.
    return (beta + torch.cholesky_solve(right - gram @ beta, factor))[..., 0]


def _at_rest(inner: Tensor, cross: Tensor, plain: Tensor, slope: Tensor) -> tuple[Tensor, Tensor]:
    """Turn derivatives g_k x into g_k x - g_k(0) e, e picking the bias: the value at rest is subtracted."""
    h = slope.shape[1]
    sums = cross[..., h]  # (B, h, p): sum_n g_k x
    inner = inner.clone()
    inner[..., -1] -= sums[..., None] * slope[:, None, None, :]
    inner[:, :, -1] -= slope[:, :, None, None] * sums[:, None]
    inner[:, :, -1, :, -1] += slope[:, :, None] * slope[:, None, :] * plain[:, h, h, None, None]
    cross = cross.clone()
    cross[:, :, -1] -= slope[..., None] * plain[:, None, h]
    return inner, cross


def _ridge(matrix: Tensor, relative: float) -> Tensor:
    diagonal = torch.diagonal(matrix, dim1=-2, dim2=-1)
    return torch.diag_embed(relative * diagonal.clamp_min(1e-300))
