"""How far what leaves differs from the model: what counts as a difference, and what is rounding."""

import numpy as np
import pytest

from auvnn.exports.check import relative

LARGE, SMALL = 58.0, 3e-4


def two_columns(small):
    """Return an array of two columns (3, 2), of which the second is small."""
    return np.array([[LARGE, small], [-LARGE, 0.0], [1.0, small / 2]])


def test_a_column_of_rounding_is_no_difference():
    # Seen on one processor and not on another: 4e-16 beside 58, where exact arithmetic has nought.
    assert relative(two_columns(4e-16), two_columns(0.0)) == 0
    assert relative(two_columns(0.0), two_columns(4e-16)) == 0


@pytest.mark.parametrize("wrong", [1e-3, 1e-6, 1e-8])
def test_a_small_column_is_held_to_its_own_size(wrong):
    found = relative(two_columns(SMALL * (1 + wrong)), two_columns(SMALL))
    # Of a column of 5e-6 of the largest element, 64 roundings of that are 3e-9.
    assert found == pytest.approx(wrong, abs=3.1e-9)


def test_a_column_that_should_be_nought_is_a_difference_beyond_rounding():
    assert relative(two_columns(1e-11), two_columns(0.0)) > 1e-9


def test_nothing_differs_from_nothing():
    assert relative(np.zeros((0, 2)), np.zeros((0, 2))) == 0
    assert relative(np.zeros((3, 2)), np.zeros((3, 2))) == 0
