"""What is thinned looks like all of it: extremes, gaps and the time base."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as some

from auvnn.app.traces import intervals, part, thin


def test_a_short_record_comes_back_as_it_is():
    t = np.arange(50) * 0.1
    found = thin(t, {"u": np.sin(t), "v": np.where(t > 2, np.nan, t)}, points=400)
    assert not found["thinned"]
    np.testing.assert_allclose(found["t"], t)
    np.testing.assert_allclose(found["series"]["u"], np.sin(t), atol=1e-5)
    assert found["series"]["v"][-1] is None and found["series"]["v"][3] is not None


@settings(max_examples=40, deadline=None)
@given(some.integers(300, 5000), some.integers(32, 400), some.integers(0, 2**32 - 1))
def test_no_extreme_is_lost_and_time_increases(count, points, seed):
    random = np.random.default_rng(seed)
    t = np.cumsum(random.uniform(0.04, 0.06, count))
    spiky = random.normal(size=count)
    spiky[random.integers(count)] = 50.0
    spiky[random.random(count) < 0.1] = np.nan
    spiky[0] = 0.0
    found = thin(t, {"a": spiky, "b": t}, points)
    values = np.array([np.nan if x is None else x for x in found["series"]["a"]])
    assert np.isclose(np.nanmax(values), np.nanmax(spiky), rtol=1e-4)
    assert np.isclose(np.nanmin(values), np.nanmin(spiky), rtol=1e-4)
    assert (np.diff(found["t"]) > 0).all()
    assert len(found["t"]) <= max(points, 16) + 2 or not found["thinned"]
    # A rising line stays one: each bucket gives its values in the order in which they came.
    b = [x for x in found["series"]["b"] if x is not None]
    assert b == sorted(b)


def test_a_gap_in_time_breaks_the_line_however_much_is_left_out():
    t = np.concatenate([np.arange(2000) * 0.05, 500 + np.arange(2000) * 0.05])
    for points in (200, 8000):
        found = thin(t, {"u": np.ones(4000)}, points)
        holes = [x for x, u in zip(found["t"], found["series"]["u"], strict=True) if u is None]
        assert len(holes) == 1 and 100 < holes[0] < 500


def test_a_million_samples_are_thinned_in_a_blink():
    import time

    t = np.arange(1_000_000) * 0.05
    series = {name: np.sin(t + k) for k, name in enumerate("uvw")}
    thin(t, series)
    began = time.process_time()
    thin(t, series)
    assert time.process_time() - began < 1.0


def test_a_part_reaches_the_border_on_both_sides():
    t = np.arange(10.0)
    assert part(t, None, None) == slice(0, 10)
    assert part(t, 2.5, 5.5) == slice(2, 7)
    assert part(t, 20.0, 30.0).stop == 10


def test_intervals_hold_what_the_mask_holds():
    t = np.arange(100) * 0.1
    mask = np.zeros(100, dtype=bool)
    mask[[0, 1, 2, 50, 99]] = True
    found = intervals(t, mask)
    np.testing.assert_allclose(found, [[-0.05, 0.25], [4.95, 5.05], [9.85, 9.95]])
    many = intervals(t, np.arange(100) % 2 == 0, most=10)
    assert len(many) == 10 and many[0][0] < 0.01 and many[-1][1] > 9.7
    assert intervals(t, np.zeros(100, dtype=bool)) == []
