"""The law of a stochastic force: covariances of cells against the integral over both, and what cells there are."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.metrics.force_law import ForceLaw, cell_for, correlation


@pytest.mark.parametrize("time", [0.1, 0.7, 5.0])
def test_covariances_of_cells_are_the_double_integral_of_the_exponential(time):
    cell, fine = 0.5, 400
    middle = (np.arange(3 * fine) + 0.5) * cell / fine
    kernel = np.exp(-np.abs(middle[:, None] - middle) / time)
    expected = kernel.reshape(3, fine, 3, fine).mean((1, 3))
    assert correlation(3, cell, time) == pytest.approx(expected, rel=2e-3, abs=1e-6)


def test_factors_give_the_covariance_in_newtons():
    law = ForceLaw(np.array([0.0, 3.0, 0.0, 0.0, 0.0, 2.0]), np.array([1.0, 2.0, 1, 1, 1, 0.4]), 0.5, 5.0)
    assert law.axes == [1, 5] and law.cells == 10
    product = law.factors @ law.factors.transpose(0, 2, 1)
    assert product[0] == pytest.approx(9.0 * correlation(10, 0.5, 2.0))
    assert product[1] == pytest.approx(4.0 * correlation(10, 0.5, 0.4))


def test_moments_fall_into_cells_that_count_from_the_start():
    law = ForceLaw(np.ones(6), np.ones(6), 0.5, 2.0)
    assert law.cell_of(np.array([0.0, 0.49, 0.5, 1.99, 2.0])).tolist() == [0, 0, 1, 3, 3]
    assert cell_for(np.array([0.1, 9.0])) == 0.2 and cell_for(np.array([9.0])) == 0.5
