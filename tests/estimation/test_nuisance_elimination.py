"""Normal equations: each way of solving them against plain linear algebra on well-scaled problems."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.estimation.nuisance_elimination import NormalEquations, carry_of

UNITS = np.array([1e-6, 1.0, 1e7, 1e-2, 1e3])


@pytest.fixture(params=range(3))
def problem(request):
    """Return columns J of very different units, an error e, and the equations of J x = e."""
    generator = np.random.default_rng(request.param)
    columns, error = generator.normal(size=(40, 5)) * UNITS, generator.normal(size=40)
    return columns, error, NormalEquations(columns.T @ columns, columns.T @ error)


def test_the_solution_is_that_of_least_squares(problem):
    columns, error, equations = problem
    expected = np.linalg.lstsq(columns / UNITS, error, rcond=None)[0]
    np.testing.assert_allclose(equations.solve() * UNITS, expected, rtol=1e-10)
    solved, volume = equations.solve_with_determinant()
    np.testing.assert_allclose(solved * UNITS, expected, rtol=1e-10)
    gram = (columns / UNITS).T @ (columns / UNITS)
    assert volume == pytest.approx(np.linalg.slogdet(gram)[1] + 2 * np.log(UNITS).sum(), rel=1e-12)


def test_the_covariance_is_the_inverse(problem):
    columns, _, equations = problem
    expected = np.linalg.inv((columns / UNITS).T @ (columns / UNITS)) / UNITS[:, None] / UNITS
    np.testing.assert_allclose(equations.covariance(), expected, rtol=1e-10)


def test_eliminated_parameters_follow_those_that_are_left(problem):
    columns, error, equations = problem
    own, others = np.array([2, 0]), np.array([1, 3, 4])
    left = equations.eliminate(own, others)
    # The partial regression: what the other columns explain is taken out of columns and error first.
    explain = columns[:, others] @ np.linalg.pinv(columns[:, others])
    bare = columns[:, own] - explain @ columns[:, own]
    np.testing.assert_allclose(left.information, bare.T @ bare, rtol=1e-8)
    np.testing.assert_allclose(left.equations.solve(), equations.solve()[own], rtol=1e-8)
    whole = equations.solve()
    rest = equations.part(others).solve() - left.carry.T @ whole[own]
    np.testing.assert_allclose(rest, whole[others], rtol=1e-8)
    np.testing.assert_allclose(equations.eliminate(own, others, rcond=1e-14).carry, left.carry, rtol=1e-6)
    slopes = columns * error[:, None]
    scores = left.scores(slopes[:, own], slopes[:, others]).sum(0)
    np.testing.assert_allclose(scores / UNITS[own], left.equations.right / UNITS[own], atol=1e-9)


def test_without_nuisance_nothing_is_taken_out(problem):
    _, _, equations = problem
    none = np.zeros(0, dtype=int)
    left = equations.eliminate(np.arange(5), none)
    assert left.carry.shape == (5, 0) and np.array_equal(left.equations.square, equations.square)
    assert carry_of(np.zeros((0, 0)), np.zeros((0, 3))).shape == (3, 0)


def test_priors_pull_towards_their_means():
    equations = NormalEquations.with_priors(np.zeros((1, 1)), np.zeros(1), np.array([4.0]), np.array([0.5]))
    assert equations.solve() == pytest.approx([-0.5])


def test_bounds_hold_and_the_others_are_solved_again(problem):
    columns, error, equations = problem
    free = equations.solve()
    low, high = np.full(5, -np.inf), np.full(5, np.inf)
    np.testing.assert_allclose(equations.bounded(low, high), free, rtol=1e-9)
    low[1] = high[1] = 0.5 * free[1]
    rest = np.array([0, 2, 3, 4])
    found = equations.bounded(low, high)
    expected = np.linalg.lstsq((columns / UNITS)[:, rest], error - columns[:, 1] * low[1], rcond=None)[0]
    assert found[1] == pytest.approx(low[1])
    np.testing.assert_allclose((found * UNITS)[rest], expected, rtol=1e-8)


def test_what_nothing_is_said_of_stays_where_it_is(problem):
    _, _, equations = problem
    square, right = np.zeros((6, 6)), np.zeros(6)
    square[:5, :5], right[:5] = equations.square, equations.right
    wider = NormalEquations(square, right)
    for found in (
        wider.solve(),
        wider.solve_with_determinant()[0],
        wider.bounded(-np.ones(6) / 0.1, np.ones(6) / 0.1),
    ):
        assert found[5] == 0.0
    np.testing.assert_allclose(wider.solve()[:5], equations.solve(), rtol=1e-12)
    assert wider.solve_with_determinant()[1] == pytest.approx(equations.solve_with_determinant()[1])
    assert not wider.covariance()[5].any()


def test_damping_shortens_the_step(problem):
    _, _, equations = problem
    short = equations.solve(damping=1e6) * UNITS
    unit = np.sqrt(np.diag(equations.square))
    np.testing.assert_allclose(short, equations.right / unit**2 * UNITS / 1e6, rtol=1e-4)
