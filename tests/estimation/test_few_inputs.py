"""Derivatives of large answers by few numbers, against forward mode and in closed form."""

import torch
from torch.func import jacfwd, vmap

from auvnn.estimation.few_inputs import Directions, slopes

DOUBLE = torch.float64


def bent(values):
    """Two outputs of different shapes, one of which leaves out a value."""
    grid = torch.linspace(0.1, 1.0, 12, dtype=DOUBLE).reshape(4, 3)
    wave = torch.sin(grid * values[0]) * torch.exp(-values[1] * grid) + values[2].abs().sqrt() * grid
    return [wave.clamp_max(0.9), torch.tanh(values[:2]).cumsum(0)]


def test_they_are_those_of_forward_mode():
    at = torch.tensor([1.3, 0.4, 2.0], dtype=DOUBLE)
    for found, expected in zip(slopes(bent, at), jacfwd(lambda x: tuple(bent(x)))(at), strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-14, atol=1e-15)


def test_a_linear_answer_has_its_matrix_wherever_it_is_asked():
    matrix = torch.randn(5, 4, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    (found,) = slopes(lambda x: [matrix @ x], torch.full((4,), 7.0, dtype=DOUBLE))
    torch.testing.assert_close(found, matrix, rtol=1e-15, atol=0.0)


def test_many_at_once_are_each_by_itself():
    many = torch.rand(6, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(2)) + 0.5
    together = vmap(lambda x: slopes(bent, x))(many)
    for k, one in enumerate(many):
        for found, expected in zip(together, slopes(bent, one), strict=True):
            torch.testing.assert_close(found[k], expected, rtol=1e-14, atol=1e-15)


def test_what_does_not_depend_on_the_numbers_has_no_slope():
    still, moving = slopes(
        lambda x: [torch.ones(3, dtype=DOUBLE), x * x], torch.tensor([2.0, 3.0], dtype=DOUBLE)
    )
    assert torch.equal(still, torch.zeros(3, 2, dtype=DOUBLE))
    assert torch.equal(moving, torch.diag(torch.tensor([4.0, 6.0], dtype=DOUBLE)))


def test_values_that_act_on_different_columns_share_a_direction_and_lose_nothing():
    def output(x):
        # Column k depends on x_k and x_{3 + k}, and all of them on x_6.
        grid = torch.linspace(0.2, 1.0, 5, dtype=DOUBLE).unsqueeze(-1)
        return [torch.sin(grid * x[:3]) * torch.exp(-x[3:6] * grid * x[6])]

    at = torch.tensor([0.5, 1.0, 2.0, 0.1, 0.2, 0.4, 1.5], dtype=DOUBLE)
    shared = Directions.together([0, 1, 2, 0, 1, 2, -1])
    assert shared.of.tolist() == [0, 0, 0, 1, 1, 1, 2]
    (found,) = slopes(output, at, shared.seeds(at))
    assert found.shape == (5, 3, 3)
    expected = jacfwd(lambda x: output(x)[0])(at)
    torch.testing.assert_close(shared.apart(found), expected, rtol=1e-14, atol=1e-15)


def test_what_may_act_on_all_shares_with_nothing():
    assert Directions.together([-1, 0, -1, 0, 1]).of.tolist() == [0, 1, 2, 3, 1]
