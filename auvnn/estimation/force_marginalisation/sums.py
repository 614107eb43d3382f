"""Sums of windows in which a stochastic force acts: initial state and force are integrated out together."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.sensitivity import Response

Array = NDArray[np.float64]
# A weak pull on each initial state towards the measured one keeps channels that were not measured in place:
# metres, radians, m/s, rad/s.
LOOSE = np.array([10.0] * 3 + [1.0] * 3 + [2.0] * 3 + [2.0] * 3)


def sums_with_force(
    answer: Response, weight: Tensor, live: list[int], *, leverage: bool
) -> tuple[Tensor, Tensor, tuple[Array, Array]]:
    """Return a response's sums after the best initial state and force.

    Args:
        answer: B windows, with a force of F independent standard normal variables.
        weight: (18,) one over the standard deviations.
        live: channels that count.
        leverage: whether the degrees of freedom are wanted.

    Returns:
        products of errors and parameters, (B, 1 + P, 1 + P); how initial state and force follow both, (B, 12 + F, 1 + P);
        the logarithm of the determinant (B,) of what is known of initial state and force, and the degrees of freedom
        (B, 18) that they take of each channel, zero where not wanted.
    """
    assert answer.force is not None
    gram = _gram(answer, weight, live)
    hidden = 12 + answer.force.shape[-1]
    root = torch.linalg.cholesky(gram[:, :hidden, :hidden] + torch.diag(_precision(hidden)))
    along = torch.linalg.solve_triangular(root, gram[:, :hidden, hidden:], upper=False)
    sums = gram[:, hidden:, hidden:] - along.mT @ along
    solved = torch.linalg.solve_triangular(root.mT, along, upper=True)
    volume = 2.0 * torch.log(torch.diagonal(root, dim1=-2, dim2=-1)).sum(-1).numpy()
    spent = np.zeros((len(gram), 18))
    if leverage:
        for k in live:
            rows = torch.cat([answer.state[:, :, k], answer.force[:, :, k]], dim=-1) * weight[k]
            share = torch.linalg.solve_triangular(root, rows.mT, upper=False)
            spent[:, k] = (share**2).sum((1, 2)).numpy()
    return sums, solved, (volume, spent)


def cost_with_force(answer: Response, weight: Tensor) -> float:
    """Return the weighted squared error of the initial states as they are, of which the likeliest force is taken away."""
    assert answer.force is not None
    size, told = answer.force.shape[-1], answer.state.shape[-2]
    live = [k for k in torch.nonzero(weight).flatten().tolist() if k < told]
    gram = _gram(answer, weight, live)
    force, error = slice(12, 12 + size), 12 + size
    root, info = torch.linalg.cholesky_ex(gram[:, force, force] + torch.eye(size, dtype=gram.dtype))
    if bool(info.any()) or not bool(torch.isfinite(gram[:, :, error]).all()):
        return float("inf")
    along = torch.linalg.solve_triangular(root, gram[:, force, error, None], upper=False)
    return float(gram[:, error, error].sum() - (along**2).sum())


def _precision(hidden: int) -> Tensor:
    return torch.as_tensor(np.concatenate([LOOSE**-2.0, np.ones(hidden - 12)]))


def _gram(answer: Response, weight: Tensor, live: list[int]) -> Tensor:
    """Return all products of the weighted columns of state, force, error and parameters, kept with the response."""
    known = answer.__dict__.get("_gram")
    if known is not None and torch.equal(known[0], weight):
        return known[1]
    assert answer.force is not None
    count, length = answer.error.shape[:2]
    parts = [x[:, :, live] for x in (answer.state, answer.force)]
    parts += [answer.error[..., live].unsqueeze(-1), answer.parameters[:, :, live]]
    columns = torch.cat(parts, dim=-1).mul_(weight[live, None]).reshape(count, length * len(live), -1)
    gram = columns.mT @ columns
    # A trial that is taken is asked for its sums next: they are the same products.
    object.__setattr__(answer, "_gram", (weight, gram))
    return gram
