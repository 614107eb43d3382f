"""The solution of a linear equation whose inverse is known, against autograd through the inverse itself."""

from __future__ import annotations

import pytest
import torch

from auvnn.physics.products import matvec, solved_to_first_order


def plainly(_, inverse, vector):
    return matvec(inverse, vector)


@pytest.mark.parametrize("kept", [6, 4])
def test_first_derivatives_are_those_through_the_inverse(kept):
    make = torch.Generator().manual_seed(1)
    root, vector = (torch.randn(*size, generator=make, dtype=torch.float64) for size in ((6, 6), (5, 6)))
    frame = torch.eye(6, dtype=torch.float64)[:, :kept]

    def of(solve, square, right):
        matrix = square @ square.mT + torch.eye(6, dtype=torch.float64)
        inverse = frame @ torch.linalg.inv(frame.mT @ matrix @ frame) @ frame.mT
        return solve(matrix, inverse, right)

    found, plain = (
        torch.func.jacrev(lambda a, b, s=solve: of(s, a, b), argnums=(0, 1))(root, vector)
        for solve in (solved_to_first_order, plainly)
    )
    torch.testing.assert_close(found, plain, rtol=1e-10, atol=1e-12)
    torch.testing.assert_close(of(solved_to_first_order, root, vector), of(plainly, root, vector))
    assert any(bool(x.abs().max() > 0.01) for x in plain), "or this says nothing"
