"""Minima within bounds, against another solver and by the conditions that hold there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

from auvnn.diagnosis.noise_law.likelihood.bounded_minimum import FAILURES, bounded_minimum

SIZE = 4


def at_minimum(sloped, low, high, seed, *, curved=lambda x: 50.0 * np.eye(len(x))):
    start = np.random.default_rng(seed).uniform(low, high)
    return bounded_minimum(sloped, curved, start, low, high, most=500, enough=1e-12)


def rosenbrock(x):
    return float(rosen(x)), rosen_der(x)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("high", [2.0, 0.7])
def test_the_minimum_is_that_of_another_solver(seed, high):
    low, high = np.full(SIZE, -0.5), np.full(SIZE, high)
    value, x = at_minimum(rosenbrock, low, high, seed)
    begin = np.random.default_rng(seed).uniform(low, high)
    other = minimize(rosen, begin, jac=rosen_der, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)))
    assert value <= other.fun + 1e-6
    assert (low <= x).all() and (x <= high).all()


def test_a_quadratic_whose_curvature_is_known_takes_one_step():
    rng, asked = np.random.default_rng(3), []
    root = rng.normal(size=(SIZE, SIZE))
    normal, best = root @ root.T + np.eye(SIZE), rng.uniform(-0.4, 0.4, size=SIZE)

    def sloped(x):
        asked.append(x)
        return float(0.5 * (x - best) @ normal @ (x - best)), normal @ (x - best)

    wide = np.full(SIZE, 10.0)
    _, x = bounded_minimum(sloped, lambda x: normal, np.zeros(SIZE), -wide, wide, most=20, enough=1e-9)
    assert x == pytest.approx(best, abs=1e-9)
    assert len(asked) == 2


def test_a_step_that_does_not_bring_enough_is_shortened():
    # A curvature that is a hundred times too small: the whole step goes far beyond the minimum.
    def sloped(x):
        return float(50.0 * x @ x), 100.0 * x

    wide = np.full(1, 100.0)
    _, x = bounded_minimum(sloped, lambda x: np.eye(1), np.ones(1), -wide, wide, most=20, enough=1e-9)
    assert x == pytest.approx([0.0], abs=1e-4)


def test_a_step_that_failed_shows_how_much_more_the_value_is_curved():
    """Where the curvature is far too small, the secant of the first step is that of the quadratic: two more end it."""
    asked = []

    def sloped(x):
        asked.append(x)
        return float(0.5 * 300.0 * (x - 0.2) @ (x - 0.2)), 300.0 * (x - 0.2)

    wide = np.full(1, 100.0)
    _, x = bounded_minimum(sloped, lambda x: np.eye(1), np.ones(1), -wide, wide, most=20, enough=1e-9)
    assert x == pytest.approx([0.2], abs=1e-6)
    assert len(asked) == 3


def test_after_a_step_that_brought_little_steps_become_long_again():
    """Behind a bend that the curvature did not foretell, a long way of one slope is gone by steps of the full length."""
    asked = []

    def sloped(x):
        asked.append(x)
        bend = 400.0 * min(float(x[0]) - 0.5, 0.0)
        return 200.0 * min(float(x[0]) - 0.5, 0.0) ** 2 - float(x[0]), np.array([bend - 1.0])

    low, high = np.zeros(1), np.full(1, 60.0)
    _, x = bounded_minimum(sloped, lambda x: np.full((1, 1), 1e-3), low, low, high, most=60, enough=1e-9)
    assert x == pytest.approx([60.0]) and len(asked) < 36


@pytest.mark.parametrize(("start", "asked_at_most"), [(3.1, 12), (5.1, 13), (7.2, 15)])
def test_after_a_step_that_brought_little_the_next_is_shorter(start, asked_at_most):
    """A quartic promises what it does not bring: with steps that stay as long, one or two more fail on the way."""
    asked = []

    def sloped(x):
        asked.append(x)
        return float(x[0] ** 4), 4.0 * x**3

    wide = np.full(1, 50.0)
    value, _ = bounded_minimum(
        sloped, lambda x: np.full((1, 1), 1e-3), np.full(1, start), -wide, wide, most=60, enough=1e-6
    )
    assert value < 1e-5 and len(asked) <= asked_at_most


def test_a_value_that_is_not_finite_beyond_a_wall_is_walked_around():
    def sloped(x):
        if x[0] > 1.0:
            return np.inf, np.full(2, np.nan)
        return float((x[0] - 0.9) ** 2 + (x[1] + 0.5) ** 2), 2.0 * (x - np.array([0.9, -0.5]))

    wide = np.full(2, 10.0)
    value, x = bounded_minimum(
        sloped, lambda x: 0.1 * np.eye(2), np.zeros(2), -wide, wide, most=60, enough=1e-9
    )
    assert x == pytest.approx([0.9, -0.5], abs=1e-4) and value < 1e-8


def test_where_every_step_fails_the_search_ends():
    # A slope that points the wrong way.
    asked = []

    def sloped(x):
        asked.append(x)
        return float(x @ x), -2.0 * x

    wide = np.full(1, 100.0)
    value, x = bounded_minimum(sloped, lambda x: np.eye(1), np.ones(1), -wide, wide, most=200, enough=1e-30)
    assert value == 1.0 and x == 1.0 and len(asked) == 1 + FAILURES


def test_nothing_is_asked_where_no_step_promises_anything():
    asked = []

    def sloped(x):
        asked.append(x)
        return 1.0, np.zeros(2)

    wide = np.full(2, 1.0)
    bounded_minimum(sloped, lambda x: np.eye(2), np.zeros(2), -wide, wide, most=20, enough=1e-9)
    assert len(asked) == 1
