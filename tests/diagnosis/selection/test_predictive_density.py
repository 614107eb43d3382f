"""Whether gains on what was left out are surely above zero, where a few windows gain very much."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

from auvnn.diagnosis.selection.predictive_density import surely_positive


def z_of(gain: np.ndarray) -> float:
    return float(gain.sum() / (np.sqrt(len(gain)) * gain.std(ddof=1)))


def test_a_few_large_gains_do_not_hide_those_of_all_others():
    rng = np.random.default_rng(4)
    gain = rng.normal(4.0, 3.0, 96)
    gain[:4] = 4000.0, 900.0, 500.0, 300.0
    assert z_of(gain) < 1.6
    assert surely_positive(gain, 3.0)
    # What is lost in a few windows counts in full.
    assert not surely_positive(-gain, 3.0) and not surely_positive(np.r_[gain[4:], -gain[:4]], 3.0)


def test_gains_that_all_windows_share_count_as_they_are():
    gain = np.random.default_rng(5).normal(1.0, 2.0, 96)
    assert 3.0 < z_of(gain) < 8.0
    assert surely_positive(gain, 3.0) and not surely_positive(gain, 8.0)
    # An effect that shows in few windows gains nothing in most: all of its gain is cut away, and its mean is still sure.
    rare = np.zeros(96)
    rare[:14] = np.random.default_rng(6).uniform(3.0, 5.0, 14)
    assert z_of(rare) > 3.0 and surely_positive(rare, 3.0)


def test_where_gains_end_is_no_matter_for_gains_without_end():
    # Nobody could predict these windows before.
    assert surely_positive(np.r_[np.full(90, 2.0) + np.arange(90) % 3, np.inf], 3.0)
    assert not surely_positive(np.r_[np.full(90, 2.0), -np.inf], 3.0)


@pytest.mark.parametrize("degrees", [2.0, 3.0, 30.0])
def test_chance_is_seldom_taken_for_a_gain(degrees):
    gains = t.rvs(degrees, size=(4000, 96), random_state=np.random.default_rng(7))
    # One side of three standard errors is 0.0013; cutting from above moves the mean down.
    assert np.mean([surely_positive(g, 3.0) for g in gains]) < 0.004
