"""The noise estimate finds the noise and nothing but the noise."""

import numpy as np
import pytest

from auvnn.logs import noise_std


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("level", [1e-4, 0.01, 1.0])
def test_finds_white_noise_under_motion(even: bool, level: float) -> None:
    rng = np.random.default_rng(0)
    t = 0.05 * np.arange(20_000) if even else np.cumsum(rng.uniform(0.03, 0.07, 20_000))
    motion = np.sin(0.5 * t) + 0.3 * np.sin(1.3 * t) + 5.0
    assert noise_std(t, motion + level * rng.normal(size=len(t))) == pytest.approx(level, rel=0.03)


def test_noise_free_motion_has_none() -> None:
    t = 0.05 * np.arange(5000)
    assert noise_std(t, 100.0 + np.sin(2.0 * t)) < 1e-7
    assert noise_std(t, np.full(5000, 3.0)) == 0.0


def test_steps_and_spikes_do_not_count() -> None:
    rng = np.random.default_rng(1)
    t = 0.05 * np.arange(5000)
    y = 0.01 * rng.normal(size=5000)
    y += np.where((t % 40) < 20, 1.0, 0.0)
    y[rng.integers(0, 5000, 10)] += 10.0
    assert noise_std(t, y) == pytest.approx(0.01, rel=0.1)


def test_held_samples_are_no_second_measurement() -> None:
    rng = np.random.default_rng(2)
    slow = np.sin(0.3 * 0.2 * np.arange(4000)) + 0.01 * rng.normal(size=4000)
    t = 0.05 * np.arange(16_000)
    assert noise_std(t, np.repeat(slow, 4)) == pytest.approx(0.01, rel=0.1)


def test_gaps_and_missing_samples_are_left_out() -> None:
    rng = np.random.default_rng(3)
    t = 0.05 * np.arange(8000)
    t[4000:] += 50.0
    y = t + 0.01 * rng.normal(size=8000)  # a ramp: the gap is a huge step
    y[100:200] = np.nan
    assert noise_std(t, y) == pytest.approx(0.01, rel=0.05)
    assert np.isnan(noise_std(t, np.full(8000, np.nan)))
    assert np.isnan(noise_std(t[:10], y[:10]))


def test_bias_by_motion_is_as_documented() -> None:
    for per_period, share in ((20, 4e-5), (10, 2.2e-3), (6, 0.035)):
        t = np.arange(2000.0)
        assert noise_std(t, np.sin(2 * np.pi * t / per_period + 0.3)) < share


def test_channels_and_long_logs() -> None:
    rng = np.random.default_rng(4)
    y = rng.normal(size=(300_000, 2)) * np.array([1.0, 0.1])
    np.testing.assert_allclose(noise_std(0.01 * np.arange(300_000), y), [1.0, 0.1], rtol=0.03)
