"""Derivatives of large answers by few numbers, as forward mode gives them, by reverse mode twice.

The vector-Jacobian product u -> J^T u is linear in u, so that its own vector-Jacobian product is v -> J v, whatever u
is: exact, with no second derivative in it. torch's forward mode gives the same, but for each product or sum of what
depends on the numbers with what does not, it asks Python for the shape of a zero, a thousandth of a second each time;
here that was half of the time of a test at the null.
Reference: Townsend (2017), "A new trick for calculating Jacobian vector products".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor
from torch.func import vjp, vmap


def slopes(function: Callable[[Tensor], Sequence[Tensor]], values: Tensor) -> list[Tensor]:
    """Return the derivative of every output by the values, each of the output's shape and P further columns.

    Args:
        function: of values (P,) to tensors of any shapes.
        values: where.
    """
    out, back = vjp(lambda x: tuple(function(x)), values)[:2]

    def across(u: tuple[Tensor, ...]) -> Tensor:
        return back(u)[0]

    _, along = vjp(across, tuple(torch.zeros_like(x) for x in out))[:2]
    eye = torch.eye(values.numel(), dtype=values.dtype, device=values.device)
    (found,) = vmap(along)(eye)
    return [x.movedim(0, -1) for x in found]
