import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auvnn.report.decimate import decimate, gaps, telling_window


@settings(max_examples=60)
@given(st.integers(1, 5000), st.integers(16, 400), st.integers(0, 2**32 - 1))
def test_no_more_points_than_allowed_and_no_peak_lost(n, limit, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.1
    y = rng.standard_cauchy(n)
    kept_t, kept_y = decimate(t, y, limit)
    assert kept_t.size == kept_y.size <= max(limit, 16)
    assert (np.diff(kept_t) >= 0).all()
    assert kept_y.min() == y.min() and kept_y.max() == y.max()
    # Every point that is kept is one of the record.
    assert set(zip(kept_t, kept_y, strict=True)) <= set(zip(t, y, strict=True))


def test_each_stretch_keeps_its_extremes():
    rng = np.random.default_rng(1)
    y = rng.standard_normal(100_000)
    t = np.arange(y.size) * 0.01
    kept_t, kept_y = decimate(t, y, 1000)
    # Two points per bucket of about 200 samples: no sample sticks out of what is kept near it.
    for start in range(0, 99_000, 3571):
        part = y[start : start + 500]
        near = (kept_t >= t[start] - 2.1) & (kept_t <= t[start + 499] + 2.1)
        assert kept_y[near].max() >= part.max() and kept_y[near].min() <= part.min()
    assert kept_t[0] == t[0] and kept_t[-1] == t[-1]


def test_a_short_record_comes_back_whole():
    t, y = np.arange(50.0), np.sin(np.arange(50.0))
    kept_t, kept_y = decimate(t, y, 100)
    np.testing.assert_array_equal(kept_t, t)
    np.testing.assert_array_equal(kept_y, y)


@pytest.mark.parametrize("n", [200, 200_000])
def test_a_gap_breaks_the_line_once(n):
    t = np.arange(n) * 0.05
    t[n // 2 :] += 100.0
    kept_t, kept_y = decimate(t, np.ones(n), 150)
    holes = np.flatnonzero(np.isnan(kept_y))
    assert holes.size == 1
    before, after = kept_t[holes[0] - 1], kept_t[holes[0] + 1]
    assert before <= t[n // 2 - 1] and after >= t[n // 2]


def test_a_slow_channel_in_a_fast_log_is_still_a_line():
    y = np.full(1000, np.nan)
    y[::10] = 1.0
    _, kept = decimate(np.arange(1000) * 0.05, y, 400)
    assert np.isfinite(kept).sum() == 100
    assert not np.isnan(kept).any()


def test_missing_stretches_break_the_line():
    y = np.ones(1000)
    y[300:500] = np.nan
    kept_t, kept_y = decimate(np.arange(1000) * 0.05, y, 2000)
    assert np.isnan(kept_y).sum() == 1
    inside = (kept_t > 300 * 0.05) & (kept_t < 499 * 0.05)
    assert not np.isfinite(kept_y[inside]).any()


@pytest.mark.parametrize("y", [[], [np.nan] * 9, [np.inf, np.nan, -np.inf]])
def test_nothing_to_draw_gives_nothing(y):
    kept_t, kept_y = decimate(np.arange(len(y)), y)
    assert kept_t.size == kept_y.size == 0


def test_very_many_gaps_leave_room_for_the_data():
    t = np.cumsum(np.where(np.arange(10_000) % 7, 0.1, 3.0))
    kept_t, kept_y = decimate(t, np.random.default_rng(0).standard_normal(t.size), 200)
    assert kept_t.size <= 200
    assert np.isfinite(kept_y).sum() >= 100


def test_gaps_are_counted_in_median_steps():
    assert gaps([0, 1, 2, 3, 7.9, 8.9, 14]).tolist() == [5]
    assert gaps([0.0]).size == 0


def test_the_window_is_where_the_error_is():
    t = np.arange(0, 600, 0.1)
    measured = np.sin(t)[:, None] * np.ones(6)
    model = measured.copy()
    near = (t > 400) & (t < 430)
    model[near, 2] += 0.5
    part = telling_window(t, measured, model, 60.0)
    assert t[part][0] <= 400.1 and t[part][-1] >= 429.9
    assert t[part][-1] - t[part][0] == pytest.approx(60.0, abs=0.2)


def test_a_diverged_moment_does_not_hide_a_long_error():
    t = np.arange(0, 600, 0.1)
    measured = np.sin(t)[:, None] * np.ones(6)
    model = measured.copy()
    model[10, 0] = 1e30
    model[4000:4300] += 5.0
    part = telling_window(t, measured, model, 60.0)
    assert part.start <= 4000 and part.stop >= 4300


def test_a_short_record_is_its_own_window():
    t = np.arange(20.0)
    assert telling_window(t, np.ones((20, 6)), np.zeros((20, 6)), 60.0) == slice(0, 20)
