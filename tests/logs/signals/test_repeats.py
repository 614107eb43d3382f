"""A sensor slower than the log is told from a vehicle at rest and from coarse resolution."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.logs.signals.repeats import repeats, stale

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize("rows", [2, 4, 10])
def test_three_of_four_rows_of_a_slow_sensor_are_old(rows):
    fresh = RANDOM.normal(size=(50, 3))
    found = repeats(np.repeat(fresh, rows, axis=0))
    np.testing.assert_array_equal(found, np.arange(50 * rows) % rows > 0)


def test_a_value_across_a_missing_row_is_still_the_old_one():
    values = np.repeat(RANDOM.normal(size=(50, 3)), 4, axis=0)
    values[5] = np.nan
    found = repeats(values)
    assert not found[5] and found[6] and not found[8]


@pytest.mark.parametrize(
    "values",
    [
        RANDOM.normal(size=(200, 3)),
        # At rest for half of the time, without noise.
        np.concatenate([np.zeros((100, 3)), RANDOM.normal(size=(100, 3))]),
        # A slow motion in steps of the sensor's resolution.
        np.round(np.sin(np.arange(400) / 60)[:, None], 1),
        np.zeros((200, 3)),
        np.repeat(RANDOM.normal(size=(5, 3)), 2, axis=0),
    ],
)
def test_others_are_taken_as_they_are(values):
    assert not repeats(values).any()


def test_each_sensor_by_itself():
    nu = RANDOM.normal(size=(200, 6))
    nu[:, :3] = np.repeat(RANDOM.normal(size=(50, 3)), 4, axis=0)
    found = stale(None, RANDOM.normal(size=(200, 4)), nu)
    assert found[:, 6:9].mean() == pytest.approx(0.75) and not found[:, [0, 2, 3, 9]].any()
