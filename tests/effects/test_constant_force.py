"""Constant wrench: against Newton's second law, axis by axis, and its tie to the body."""

from __future__ import annotations

import math

import pytest
import torch

WRENCH = {"X": 7.0, "Y": -8.0, "Z": 9.0, "K": 0.3, "M": -0.45, "N": 0.65}
INERTIA = [70, 80, 90, 3, 4.5, 6.5]


def test_a_resting_free_body_accelerates_by_force_over_inertia(plain, level, still):
    found = plain({"constant_force": WRENCH})(level, still, still)
    expected = [f / m for f, m in zip(WRENCH.values(), INERTIA, strict=True)]
    assert found.tolist() == pytest.approx(expected, 1e-14)


def test_it_turns_with_the_body(plain, vector, still, level):
    model = plain({"constant_force": WRENCH})
    turned = model(vector(3, 4, 5, 1.0, 0.5, math.pi / 3), still, still)
    torch.testing.assert_close(turned, model(level, still, still), rtol=0, atol=1e-14)


def test_it_cancels_a_command_of_the_opposite_sign(plain, level, still, vector):
    model = plain({"constant_force": WRENCH})
    assert model(level, still, -vector(*WRENCH.values())).abs().max() < 1e-15
