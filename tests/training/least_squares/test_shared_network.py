"""One network with several outputs: against automatic differentiation, least squares and scipy."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from auvnn.training.least_squares.batched import LeastSquares, Rules
from auvnn.training.least_squares.shared_network import SharedProblems
from tests.training.problems import problem


def made(samples: int = 40, hidden: int = 3) -> tuple[SharedProblems, torch.Tensor, torch.Tensor]:
    found = problem(samples)
    x = torch.cat([found.nu, found.nu.abs()], 1) / 0.3
    return (
        SharedProblems(x, found.target / found.target.std(0), hidden),
        x,
        found.target / found.target.std(0),
    )


def outputs(x: torch.Tensor, theta: torch.Tensor, beta: torch.Tensor, hidden: int) -> torch.Tensor:
    layer, rows = theta.view(hidden, -1), beta.view(6, hidden + 1)
    units = torch.tanh(x @ layer[:, :-1].T + layer[:, -1])
    return units @ rows[:, :-1].T + rows[:, -1]


def test_the_normal_equations_are_those_of_the_whole_jacobian():
    problems, x, y = made()
    generator = torch.Generator().manual_seed(0)
    theta = torch.cat([problems.draw(generator) for _ in range(2)])
    beta = torch.randn(2, problems.outer_size, generator=generator, dtype=torch.float64)
    found = problems.normal(theta, beta, torch.zeros(2, dtype=torch.int64))
    for k in range(2):

        def residual(t, b):
            return (outputs(x, t, b, 3) - y).flatten()

        by_theta, by_beta = torch.autograd.functional.jacobian(residual, (theta[k], beta[k]))
        left = residual(theta[k], beta[k])
        expected = (
            by_theta.T @ by_theta,
            by_theta.T @ by_beta,
            by_beta.T @ by_beta,
            by_theta.T @ left,
            by_beta.T @ left,
        )
        for ours, wanted in zip(found.tensors(), expected, strict=True):
            torch.testing.assert_close(ours[k], wanted, rtol=1e-9, atol=1e-9 * float(wanted.abs().max()))
        cost = problems.cost(theta, beta, torch.zeros(2, dtype=torch.int64))[k]
        torch.testing.assert_close(cost, left.square().mean())


def test_the_output_layer_is_the_least_squares_solution():
    problems, x, y = made()
    theta = problems.draw(torch.Generator().manual_seed(0))
    beta, cost = problems.solve_outer(theta, torch.zeros(1, dtype=torch.int64))
    layer = theta.view(3, -1).numpy()
    units = np.tanh(x.numpy() @ layer[:, :-1].T + layer[:, -1])
    columns = np.column_stack([units, np.ones(len(units))])
    exact = np.linalg.lstsq(columns, y.numpy(), rcond=None)[0]
    np.testing.assert_allclose(beta.view(6, 4).T, exact, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(float(cost[0]), np.mean((columns @ exact - y.numpy()) ** 2), rtol=1e-9)


def test_it_ends_where_scipy_cannot_improve():
    problems, x, y = made(60, 2)
    one = torch.ones(1, dtype=torch.float64)
    solver = LeastSquares(
        problems, None, one, Rules(2, 50, 400, 1e-12, 20, 30, 0.3, None), None, torch.Generator()
    )
    while solver.running:
        solver.step()
    theta, beta, cost, _ = solver.best()

    def residual(p):
        both = torch.tensor(p)
        return (outputs(x, both[:26], both[26:], 2) - y).flatten().numpy()

    start = torch.cat([theta[0], beta[0]]).numpy()
    assert np.mean(residual(start) ** 2) == pytest.approx(float(cost[0]), rel=1e-9)
    polished = least_squares(residual, start, method="lm", xtol=1e-15, ftol=1e-15, max_nfev=2000)
    assert np.mean(polished.fun**2) > float(cost[0]) * (1 - 1e-3)
