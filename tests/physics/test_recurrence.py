"""Recurrences over time against the loop that they stand for."""

from __future__ import annotations

import pytest
import torch

from auvnn.physics.recurrence import closing_gap, first_order_recurrence

DOUBLE = torch.float64


def by_loop(left, added):
    x, found = torch.zeros_like(added[..., 0, :]), []
    for k in range(added.shape[-2]):
        x = left[..., k, :] * x + added[..., k, :]
        found.append(x)
    return torch.stack(found, dim=-2)


@pytest.mark.parametrize("rows", [1, 2, 3, 7, 8, 9, 100])
@pytest.mark.parametrize("columns", [1, 3])
def test_values_and_slopes_are_those_of_the_loop(rows, columns):
    generator = torch.Generator().manual_seed(rows)
    left = torch.rand(2, rows, columns, generator=generator, dtype=DOUBLE, requires_grad=True)
    added = torch.randn(2, rows, 3, generator=generator, dtype=DOUBLE, requires_grad=True)
    up = torch.randn(2, rows, 3, generator=generator, dtype=DOUBLE)
    found = []
    for how in (first_order_recurrence, by_loop):
        value = how(left, added)
        # Nothing is left before the first row, whose share has no slope.
        found.append([value, *torch.autograd.grad(value, (left, added), up, allow_unused=True)])
    for mine, theirs in zip(*found, strict=True):
        mine = torch.zeros_like(left) if mine is None else mine
        torch.testing.assert_close(mine, theirs, rtol=1e-13, atol=1e-13)


def test_the_gap_to_a_demand_closes_as_an_exponential_does():
    """x' = (demand - x) / tau from x = 0, the demand being one from the second row on: 1 - exp(-t / tau)."""
    times, tau = torch.cumsum(torch.linspace(0.02, 0.2, 40, dtype=DOUBLE), 0), 0.7
    demand = torch.ones(40, 1, dtype=DOUBLE)
    demand[0] = 0.0
    left = torch.exp(-(times[1:] - times[:-1]) / tau).unsqueeze(-1)
    expected = torch.zeros(40, dtype=DOUBLE)
    expected[1:] = -torch.exp(-(times[1:] - times[1]) / tau)
    torch.testing.assert_close(closing_gap(demand, left).squeeze(-1), expected, rtol=1e-13, atol=1e-15)


def test_a_demand_that_stays_leaves_no_gap_and_no_share_left_the_last_jump_alone():
    demand = torch.tensor([0.1, 0.1, 0.1, 0.7, 0.7], dtype=DOUBLE).unsqueeze(-1)
    left = torch.full((4, 1), 0.6, dtype=DOUBLE)
    assert not closing_gap(demand, left)[:3].any()
    assert closing_gap(demand, 0.0 * left).squeeze(-1).tolist() == [0.0, 0.0, 0.0, 0.1 - 0.7, 0.0]
    assert closing_gap(demand[:1], left[:0]).tolist() == [[0.0]]
