"""How large a force without a name is said to be, on slopes drawn with a force of a known size."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.residuals.unnamed_size import sizes

COUNT, WINDOWS, UNIT = 7, 60, np.array([10.0, 10.0, 10.0, 1.0, 1.0, 1.0])


def drawn(rng, variance, information=4.0):
    """Slopes and information of six degrees of freedom that know nothing of one another, a force in the first."""
    hessian = np.zeros((WINDOWS, 6 * COUNT, 6 * COUNT))
    hessian[:] = information * np.eye(6 * COUNT)
    theta = np.zeros((WINDOWS, 6 * COUNT))
    theta[:, :COUNT] = np.sqrt(variance) * rng.normal(size=(WINDOWS, COUNT))
    noise = np.sqrt(information) * rng.normal(size=(WINDOWS, 6 * COUNT))
    return np.einsum("wij,wj->wi", hessian, theta) + noise, hessian


def test_the_root_mean_square_is_that_of_the_force_and_the_limit_holds():
    rng = np.random.default_rng(1)
    truth = 10.0 * np.sqrt(4 * 0.25)
    found = [sizes(*drawn(rng, 0.25), ["X"], UNIT, 5.0)["X"] for _ in range(50)]
    assert np.mean([s.rms for s in found]) == pytest.approx(truth, rel=0.05)
    assert np.mean([s.upper > truth for s in found]) > 0.88


def test_where_there_is_none_the_limit_is_small_and_what_would_show_does_show():
    rng = np.random.default_rng(2)
    none = sizes(*drawn(rng, 0.0), [], UNIT, 5.0)
    assert none["X"].upper < none["X"].detectable
    assert none["K"].detectable == pytest.approx(0.1 * none["X"].detectable, rel=1e-9)
    # At the size that is said to show, the sum of squared slopes is beyond chance in nearly all logs.
    variance = (none["X"].detectable / 10.0) ** 2 / 4.0
    seen = 0
    for _ in range(200):
        slope, _ = drawn(rng, variance)
        above = (slope[:, :COUNT] ** 2).sum() - 4.0 * WINDOWS * COUNT
        seen += above > 3.59 * np.sqrt(2.0 * WINDOWS * COUNT * 16.0)
    assert seen > 0.88 * 200


def test_a_force_that_lasts_has_no_correlation_time_and_one_of_the_third_harmonic_has_its_own():
    rng = np.random.default_rng(3)
    slope, hessian = drawn(rng, 0.0, 400.0)
    theta = np.zeros((WINDOWS, 6 * COUNT))
    theta[:, 0] = rng.normal(size=WINDOWS)
    lasting = np.einsum("wij,wj->wi", hessian, theta) + slope
    assert sizes(lasting, hessian, ["X"], UNIT, 5.0)["X"].correlation_time is None
    theta[:, 0], theta[:, [3, 6]] = 0.0, rng.normal(size=(WINDOWS, 2))
    fast = np.einsum("wij,wj->wi", hessian, theta) + slope
    time = sizes(fast, hessian, ["X"], UNIT, 5.0)["X"].correlation_time
    assert time == pytest.approx(5.0 / (2 * np.pi * 3), rel=0.1)
