"""The hand-written normal equations against Jacobians by automatic differentiation."""

from __future__ import annotations

import pytest
import torch
from torch.func import jacfwd

from auvnn.damping.dissipative import Dissipative
from auvnn.damping.mlp import MLP
from auvnn.training.least_squares.forms import FormProblems, pack, unpack
from auvnn.training.least_squares.networks import NetworkProblems


def numbers(*shape, seed=0):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def output(inputs, theta, beta, hidden, rest):
    layer = theta.view(hidden, inputs.shape[1] + 1)
    units = torch.tanh(inputs @ layer[:, :-1].T + layer[:, -1])
    if rest:
        return (units - torch.tanh(layer[:, -1])) @ beta
    return units @ beta[:hidden] + beta[hidden]


def check(normal, jacobians, residual, weight):
    inner, outer = jacobians
    expected = (
        inner.T @ (weight[:, None] * inner),
        inner.T @ (weight[:, None] * outer),
        outer.T @ (weight[:, None] * outer),
        inner.T @ (weight * residual),
        outer.T @ (weight * residual),
    )
    for found, right in zip(normal, expected, strict=True):
        torch.testing.assert_close(found, right, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("hidden", [1, 5])
def test_networks(rest, weighted, hidden):
    # 1500 samples: more than one block, and a last one that is not full.
    inputs, targets = numbers(1500, 12), numbers(3, 1500, seed=1)
    weights = numbers(3, 1500, seed=2).abs() if weighted else None
    problems = NetworkProblems(inputs, targets, weights, hidden, rest)
    theta = numbers(4, problems.inner_size, seed=3) * 0.4
    beta, member = numbers(4, problems.outer_size, seed=4), torch.tensor([0, 2, 2, 1])
    normal = problems.normal(theta, beta, member)
    cost = problems.cost(theta, beta, member)
    for row, axis in enumerate(member.tolist()):
        weight = torch.ones(1500, dtype=torch.float64) if weights is None else weights[axis]
        jacobians = jacfwd(output, (1, 2))(inputs, theta[row], beta[row], hidden, rest)
        residual = output(inputs, theta[row], beta[row], hidden, rest) - targets[axis]
        check([tensor[row] for tensor in normal.tensors()], jacobians, residual, weight)
        torch.testing.assert_close(cost[row], (weight * residual**2).sum() / weight.sum())


@pytest.mark.parametrize("rest", [False, True])
def test_the_output_layer_is_the_least_squares_solution(rest):
    inputs, targets, weights = numbers(300, 12), numbers(2, 300, seed=1), numbers(2, 300, seed=2).abs()
    problems = NetworkProblems(inputs, targets, weights, 5, rest)
    theta = problems.draw(torch.Generator().manual_seed(0))
    beta, cost = problems.solve_outer(theta, torch.arange(2))
    for axis in range(2):
        basis = jacfwd(output, 2)(inputs, theta[axis], beta[axis], 5, rest)
        root = weights[axis].sqrt()
        solution = torch.linalg.lstsq(root[:, None] * basis, (root * targets[axis])[:, None]).solution[:, 0]
        torch.testing.assert_close(beta[axis], solution, rtol=1e-6, atol=1e-8)
        best = (weights[axis] * (basis @ solution - targets[axis]) ** 2).sum() / weights[axis].sum()
        torch.testing.assert_close(cost[axis], best)


@pytest.mark.parametrize("weighted", [False, True])
def test_any_form(weighted):
    form, nu, targets = Dissipative((4, 0)), numbers(5000, 6), numbers(2, 5000, seed=1)
    weights = numbers(2, 5000, seed=2).abs() if weighted else None
    problems = FormProblems(form, nu, targets, weights)
    theta, member = pack(form)[[1, 0, 1]] + 0.2 * numbers(3, problems.inner_size), torch.tensor([1, 0, 1])
    normal = problems.normal(theta, theta[:, :0], member)
    cost = problems.cost(theta, theta[:, :0], member)
    for row, axis in enumerate(member.tolist()):

        def value(rows, axis=axis):
            names, start, state = dict(form.named_parameters()), 0, {}
            for name, tensor in names.items():
                size = tensor[0].numel()
                own = tensor.detach().clone()
                other = [
                    own[i] if i != axis else rows[start : start + size].view(own[0].shape) for i in (0, 1)
                ]
                state[name], start = torch.stack(other), start + size
            return torch.func.functional_call(form, state, (nu,))[:, axis]

        jacobian, residual = jacfwd(value)(theta[row]), value(theta[row]) - targets[axis]
        weight = torch.ones(5000, dtype=torch.float64) if weights is None else weights[axis]
        check([t[row] for t in normal.tensors()], (jacobian, jacobian[:, :0]), residual, weight)
        torch.testing.assert_close(cost[row], (weight * residual**2).sum() / weight.sum())


def test_a_network_is_the_same_problem_by_hand_and_by_autograd():
    form = MLP((2,))
    nu, targets = numbers(200, 6), numbers(1, 200, seed=1)
    by_hand = NetworkProblems(form.features(nu), targets, None, 5)
    theta = torch.cat([form.hidden_weight, form.hidden_bias[..., None]], -1).detach().flatten(1)
    beta = torch.cat([form.output_weight, form.output_bias[:, None]], 1).detach()
    member = torch.zeros(1, dtype=torch.int64)
    by_autograd = FormProblems(form, nu, targets, None)
    packed = pack(form)
    torch.testing.assert_close(
        by_hand.cost(theta, beta, member), by_autograd.cost(packed, beta[:, :0], member)
    )
    one, other = by_hand.normal(theta, beta, member), by_autograd.normal(packed, beta[:, :0], member)
    trace = one.inner.diagonal(dim1=1, dim2=2).sum() + one.outer.diagonal(dim1=1, dim2=2).sum()
    torch.testing.assert_close(trace, other.inner.diagonal(dim1=1, dim2=2).sum())


def test_pack_and_unpack_are_inverse():
    form, fresh = Dissipative((0, 1, 5)), Dissipative((0, 1, 5))
    form.reset(torch.Generator().manual_seed(8))
    unpack(fresh, pack(form))
    assert all(torch.equal(a, b) for a, b in zip(form.parameters(), fresh.parameters(), strict=True))
