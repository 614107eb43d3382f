"""The local polynomial against scipy's Savitzky-Golay filter, exact polynomials and measured noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from auvnn.errors import ConfigError
from auvnn.logs import LocalPolynomial, bandwidth_hz, local_polynomial, noise_gain, response


@pytest.mark.parametrize(("half_width", "order"), [(1, 1), (2, 2), (4, 2), (4, 3), (6, 4), (10, 5)])
@pytest.mark.parametrize("shape", [(300,), (300, 3)])
def test_equal_to_savgol_on_even_time(half_width: int, order: int, shape: tuple[int, ...]) -> None:
    y = np.random.default_rng(0).normal(size=shape)
    dt = 0.05
    smooth, slope = local_polynomial(dt * np.arange(300), y, half_width, order)
    window = 2 * half_width + 1
    assert smooth.shape == slope.shape == shape
    reference = savgol_filter(y, window, order, axis=0, mode="interp")
    np.testing.assert_allclose(smooth, reference, rtol=0, atol=1e-11)
    reference = savgol_filter(y, window, order, deriv=1, delta=dt, axis=0, mode="interp")
    np.testing.assert_allclose(slope, reference, rtol=0, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), half_width=st.integers(1, 6), order=st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_exact_for_polynomials_on_any_time(seed: int, half_width: int, order: int) -> None:
    order = min(order, 2 * half_width)
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 0.15, 60)) + rng.uniform(-100, 100)
    polynomial = np.polynomial.Polynomial(rng.normal(size=order + 1), domain=[t[0], t[-1]])
    smooth, slope = local_polynomial(t, polynomial(t), half_width, order)
    np.testing.assert_allclose(smooth, polynomial(t), atol=1e-9)
    np.testing.assert_allclose(slope, polynomial.deriv()(t), atol=1e-7)


def test_uneven_path_agrees_with_a_fit_by_hand() -> None:
    rng = np.random.default_rng(1)
    t, y = np.cumsum(rng.uniform(0.05, 0.15, 40)), rng.normal(size=40)
    smooth, slope = local_polynomial(t, y, 3, 2)
    for i in (0, 2, 3, 20, 38, 39):
        start = min(max(i - 3, 0), 40 - 7)
        part = slice(start, start + 7)
        fit = np.polynomial.Polynomial.fit(t[part], y[part], 2)
        assert smooth[i] == pytest.approx(fit(t[i]), abs=1e-10)
        assert slope[i] == pytest.approx(fit.deriv()(t[i]), abs=1e-8)


def test_no_window_reaches_across_a_gap() -> None:
    t = np.concatenate([np.arange(30), 100 + np.arange(30)]) * 0.1
    y = np.where(t < 5, 1.0, -1.0)  # a filter across the gap would see the step
    smooth, slope = local_polynomial(t, y, 4, 2)
    np.testing.assert_allclose(smooth, y, atol=1e-12)
    np.testing.assert_allclose(slope, 0.0, atol=1e-11)
    whole, _ = local_polynomial(t, y, 4, 2, max_gap=100.0)
    assert np.abs(whole - y).max() > 0.01


def test_a_missing_sample_makes_its_windows_missing_and_no_other() -> None:
    y = np.random.default_rng(0).normal(size=(50, 2))
    y[20, 0] = np.nan
    for t in (0.1 * np.arange(50), np.cumsum(np.random.default_rng(1).uniform(0.08, 0.12, 50))):
        smooth, slope = local_polynomial(t, y, 4, 2)
        expected = np.abs(np.arange(50) - 20) <= 4
        np.testing.assert_array_equal(np.isnan(smooth[:, 0]), expected)
        np.testing.assert_array_equal(np.isnan(slope[:, 0]), expected)
        assert np.isfinite(smooth[:, 1]).all()


def test_a_stretch_shorter_than_the_window_is_missing() -> None:
    smooth, slope = local_polynomial(0.1 * np.arange(5), np.ones(5), 4, 2)
    assert np.isnan(smooth).all()
    assert np.isnan(slope).all()


def test_weights_are_the_operator() -> None:
    rng = np.random.default_rng(2)
    t, y = np.cumsum(rng.uniform(0.05, 0.15, 30)), rng.normal(size=30)
    operator = LocalPolynomial(t, 3, 2)
    smooth, slope = operator(y)
    windows = y[operator.start[:, None] + np.arange(operator.window)]
    np.testing.assert_allclose((operator.smoothing * windows).sum(axis=1), smooth, atol=1e-12)
    np.testing.assert_allclose((operator.differentiating * windows).sum(axis=1), slope, atol=1e-11)
    z = rng.normal(size=30)
    np.testing.assert_allclose(operator(2.0 * y + z)[1], 2.0 * slope + operator(z)[1], atol=1e-10)


@pytest.mark.parametrize(("half_width", "order"), [(4, 2), (8, 3), (3, 4)])
def test_bandwidth_is_where_a_sine_falls_by_3_db(half_width: int, order: int) -> None:
    dt = 0.02
    t = dt * np.arange(4000)
    for of, index in (("value", 0), ("derivative", 1)):
        f = bandwidth_hz(dt, half_width, order, of)  # type: ignore[arg-type]
        truth = np.sin(2 * np.pi * f * t), 2 * np.pi * f * np.cos(2 * np.pi * f * t)
        seen = local_polynomial(t, truth[0], half_width, order)[index][100:-100]
        ratio = np.linalg.norm(seen) / np.linalg.norm(truth[index][100:-100])
        assert ratio == pytest.approx(np.sqrt(0.5), abs=2e-3)


def test_bandwidth_of_a_filter_that_passes_everything_is_nyquist() -> None:
    assert bandwidth_hz(0.1, 1, 2, of="value") == pytest.approx(5.0)
    value, slope = response([0.0], 0.1, 4, 2)
    assert value[0] == pytest.approx(1.0)
    assert slope[0] == pytest.approx(1.0)


def test_noise_gain_is_what_white_noise_leaves() -> None:
    y = np.random.default_rng(3).normal(size=200_000)
    smooth, slope = local_polynomial(0.05 * np.arange(len(y)), y, 5, 2)
    gains = noise_gain(0.05, 5, 2)
    assert smooth.std() == pytest.approx(gains[0], rel=0.02)
    assert slope.std() == pytest.approx(gains[1], rel=0.02)


@pytest.mark.parametrize(("half_width", "order"), [(0, 1), (2, 5), (2, 0)])
def test_impossible_filters_are_refused(half_width: int, order: int) -> None:
    with pytest.raises(ConfigError, match="does not exist"):
        LocalPolynomial(np.arange(10.0), half_width, order)


def test_signal_of_another_length_is_refused() -> None:
    with pytest.raises(ConfigError, match="does not fit"):
        local_polynomial(np.arange(10.0), np.ones(9), 2, 2)
