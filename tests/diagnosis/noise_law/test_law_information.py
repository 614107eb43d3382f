"""Fisher's information of a law, against second differences of the expected likelihood of one dense Gaussian."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.noise_law.likelihood.law_information import law_information
from auvnn.metrics.force_law import correlation

CELLS, CELL, ROWS = 5, 0.5, 30


def covariance(seen, x):
    """Of the errors of one window: white noise of one, and forces in two degrees of freedom."""
    out = np.eye(ROWS)
    for i in range(2):
        own = seen[:, i * CELLS : (i + 1) * CELLS]
        out += np.exp(2.0 * x[i]) * own @ correlation(CELLS, CELL, float(np.exp(x[2 + i]))) @ own.T
    return out


def expected(windows, x, truth):
    """Minus twice the log likelihood that is expected where `truth` is true."""
    value = 0.0
    for seen in windows:
        whole = covariance(seen, x)
        value += np.linalg.slogdet(whole)[1] + np.trace(np.linalg.solve(whole, covariance(seen, truth)))
    return value


@pytest.mark.parametrize("size", [0.02, 1.0])
def test_it_is_the_curvature_of_the_expected_likelihood(size):
    rng = np.random.default_rng(0)
    windows = size * rng.normal(size=(3, ROWS, 2 * CELLS))
    truth, step = np.log([1.0, 2.0, 0.4, 3.0]), 1e-3
    told = law_information(
        np.einsum("brp,brq->bpq", windows, windows), CELL, np.exp(truth[:2]), np.exp(truth[2:])
    )
    units = step * np.eye(4)
    for i, one in enumerate(units):
        for j, other in enumerate(units):
            corners = [
                expected(windows, truth + a * one + b * other, truth) for a in (1, -1) for b in (1, -1)
            ]
            curved = (corners[0] - corners[1] - corners[2] + corners[3]) / (4.0 * step**2)
            assert told[i, j] == pytest.approx(
                curved, rel=2e-3, abs=2e-3 * told[i, i] ** 0.5 * told[j, j] ** 0.5
            )
