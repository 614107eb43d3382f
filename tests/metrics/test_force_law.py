"""The law of a stochastic force: covariances of cells against the integral over both, and what cells there are."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.metrics.force_law import ForceLaw, cell_for, correlation, covariance_with_end, given_the_first


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


def test_what_follows_a_known_value_is_what_the_whole_process_makes_of_it():
    """Against a grid of values of the process: conditioned on the first one by the Gaussian rule."""
    cell, fine, time = 0.5, 200, 0.7
    place = np.concatenate([[0.0], (np.arange(3 * fine) + 0.5) * cell / fine, [3 * cell]])
    whole = np.exp(-np.abs(place[:, None] - place) / time)
    means = np.zeros((4, len(place)))
    for k in range(3):
        means[k, 1 + k * fine : 1 + (k + 1) * fine] = 1.0 / fine
    means[3, -1] = 1.0
    on, root = given_the_first(3, cell, torch.tensor(time, dtype=torch.float64))
    assert on.numpy() == pytest.approx(means @ whole[:, 0], rel=1e-4)
    left = means @ (whole - np.outer(whole[:, 0], whole[0])) @ means.T
    assert (root @ root.T).numpy() == pytest.approx(left, abs=1e-4)


def test_laws_of_several_times_are_worked_out_side_by_side():
    times = torch.tensor([1e4, 0.02, 0.7], dtype=torch.float64)
    together = covariance_with_end(3, 0.5, times)
    for time, own in zip(times, together, strict=True):
        assert torch.allclose(own, covariance_with_end(3, 0.5, time), rtol=0, atol=1e-14)
    # Of cells that are short beside the time their means are values, a cell apart.
    assert together[0, 0, :3].numpy() == pytest.approx(np.exp(-0.5 * np.arange(3) / 1e4), abs=1e-8)
