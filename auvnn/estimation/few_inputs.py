"""Derivatives of large answers by few numbers, as forward mode gives them, by reverse mode twice.

The vector-Jacobian product u -> J^T u is linear in u, so that its own vector-Jacobian product is v -> J v, whatever u
is: exact, with no second derivative in it. torch's forward mode gives the same, but for each product or sum of what
depends on the numbers with what does not, it asks Python for the shape of a zero, a thousandth of a second each time;
here that was half of the time of a test at the null.
Reference: Townsend (2017), "A new trick for calculating Jacobian vector products".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.func import vjp, vmap


@dataclass(frozen=True)
class Directions:
    """Directions along which values are differentiated, each for several values that act on different outputs.

    A value that acts on one column of the outputs alone shares its direction with such as act on other columns. Their
    sum's derivative holds those of all of them: exact, with fewer directions than values.
    Reference: Curtis, Powell and Reid (1974), "On the estimation of sparse Jacobian matrices", IMA Journal of Applied
    Mathematics 13(1).

    Attributes:
        of: direction of each value, (P,).
        only: column of the outputs on which each value acts, (P,); -1 where it may act on all.
    """

    of: Tensor
    only: Tensor

    @classmethod
    def together(cls, only: Sequence[int]) -> Directions:
        """Return as few directions as there can be, from the column on which each value acts, or -1 for all."""
        of: list[int] = []
        taken: list[set[int]] = []
        for column in only:
            # The first direction that has room: none of one value that acts on all, none with this column in it.
            free = [k for k, columns in enumerate(taken) if column >= 0 and not columns & {-1, column}]
            if not free:
                taken.append(set())
            k = free[0] if free else len(taken) - 1
            taken[k].add(column)
            of.append(k)
        return cls(torch.tensor(of), torch.tensor(list(only)))

    def seeds(self, like: Tensor) -> Tensor:
        """Return the directions, (D, P), in the type of a tensor."""
        each = torch.arange(int(self.of.max()) + 1).unsqueeze(-1)
        return (self.of == each).to(like)

    def apart(self, slope: Tensor) -> Tensor:
        """Return the derivative by each value, (..., n, P), from those along the directions, (..., n, D)."""
        columns = torch.arange(slope.shape[-2], device=slope.device).unsqueeze(-1)
        only = self.only.to(slope.device)
        return slope[..., self.of.to(slope.device)] * ((only < 0) | (only == columns)).to(slope)


def slopes(
    function: Callable[[Tensor], Sequence[Tensor]], values: Tensor, along: Tensor | None = None
) -> list[Tensor]:
    """Return the derivative of every output by the values, each of the output's shape and P further columns.

    Args:
        function: of values (P,) to tensors of any shapes.
        values: where.
        along: directions (D, P) to differentiate along, D columns instead of P; by default each value by itself.
    """
    out, back = vjp(lambda x: tuple(function(x)), values)[:2]

    def across(u: tuple[Tensor, ...]) -> Tensor:
        return back(u)[0]

    forward = vjp(across, tuple(torch.zeros_like(x) for x in out))[1]
    if along is None:
        along = torch.eye(values.numel(), dtype=values.dtype, device=values.device)
    (found,) = vmap(forward)(along)
    return [x.movedim(0, -1) for x in found]
