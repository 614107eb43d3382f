"""The lean products on which the physics rests: matrix times vector, cross product, constant bilinear form.

In eager PyTorch the number of operations is the cost, not their size. Cross products, quaternion products
and rotation matrices are bilinear in their arguments with coefficients 0, +-1, +-2, so each is written as
one outer product and one matrix product with a constant table instead of dozens of scalar operations.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import linear


def matvec(matrix: Tensor, vector: Tensor) -> Tensor:
    """Multiply a matrix (..., m, n) by a vector (..., n) in as few operations as possible.

    One matrix for all vectors, the usual case, is a single operation; otherwise leading shapes broadcast.
    """
    if matrix.dim() == 2:
        return linear(vector, matrix)
    return torch.matmul(matrix, vector.unsqueeze(-1)).squeeze(-1)


def solved_to_first_order(matrix: Tensor, inverse: Tensor, vector: Tensor) -> Tensor:
    """Return the solution x of M x = f with its first derivatives, without a derivative of the known inverse.

    From M x = f follows dx = M^-1 (df - dM x). Derivatives of these derivatives are wrong.

    Args:
        matrix: M, (..., n, n).
        inverse: its inverse, or K (K^T M K)^-1 K^T where x is confined to the columns of K.
        vector: f, (..., n).
    """
    inverse = inverse.detach()
    settled = matvec(inverse, vector.detach())
    return settled + matvec(inverse, vector - matvec(matrix, settled))


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Return a x b for vectors (..., 3) whose leading shapes broadcast, also with unequal numbers of them."""
    if a.dim() != b.dim():  # torch.linalg.cross broadcasts sizes, but not ranks
        a, b = torch.broadcast_tensors(a, b)
    return torch.linalg.cross(a, b)


def per_vector(number: float | Tensor) -> float | Tensor:
    """Shape a number, or one number per sample (...), so that it multiplies a vector per sample (..., n)."""
    return number.unsqueeze(-1) if isinstance(number, Tensor) and number.dim() > 0 else number


class ProductTable:
    """A constant matrix that follows the dtype and device of the tensors it meets.

    Both floating types are made once on the CPU, at import and outside inference mode, so that neither
    ``torch.func`` transforms nor ``torch.inference_mode`` can leave a wrapped tensor behind in a cache.
    """

    def __init__(self, rows: Sequence[Sequence[float | int]]) -> None:
        """Store the rows of the matrix as float32 and float64."""
        with torch.inference_mode(False):
            self._made = {
                dtype: torch.tensor(rows, dtype=dtype, device="cpu")
                for dtype in (torch.float32, torch.float64)
            }

    def like(self, x: Tensor) -> Tensor:
        """Return the table in the dtype and on the device of ``x``."""
        made = self._made.get(x.dtype)
        if made is None:
            return self._made[torch.float64].to(dtype=x.dtype, device=x.device)
        return made if x.is_cpu else made.to(x.device)


class Bilinear:
    """A constant bilinear map: result_k = sum_ij T_ijk a_i b_j.

    Args:
        n_a: length of a.
        n_b: length of b.
        n_out: length of the result.
        terms: tuples (i, j, k, coefficient); repeated ones add up.
    """

    def __init__(self, n_a: int, n_b: int, n_out: int, terms: Sequence[tuple[int, int, int, float]]) -> None:
        """Lay the terms out as a table with one row per pair (i, j)."""
        rows = [[0.0] * n_out for _ in range(n_a * n_b)]
        for i, j, k, coefficient in terms:
            rows[i * n_b + j][k] += coefficient
        self.table = ProductTable(rows)

    def __call__(self, a: Tensor, b: Tensor) -> Tensor:
        """Return the form of a (..., n_a) and b (..., n_b), shape (..., n_out)."""
        outer = (a.unsqueeze(-1) * b.unsqueeze(-2)).flatten(-2)
        return torch.matmul(outer, self.table.like(outer))


LEVI_CIVITA = (
    (0, 1, 2, 1.0),
    (1, 2, 0, 1.0),
    (2, 0, 1, 1.0),
    (1, 0, 2, -1.0),
    (2, 1, 0, -1.0),
    (0, 2, 1, -1.0),
)
"""Terms (i, j, k, sign) of the cross product: (a x b)_k = sum sign a_i b_j."""
