"""Munk moment: against Kirchhoff's energy of a body in unbounded fluid, and a factor of zero."""

from __future__ import annotations

import numpy as np
import pytest
import torch


@pytest.mark.parametrize("factors", [{"pitch": 0.0, "yaw": 0.0}, {"pitch": 0.6, "yaw": 1.5}])
def test_the_moment_is_that_of_impulse_and_velocity(plain, level, still, factors):
    """Kirchhoff: the moment on a translating body is -v x P = P x v with the impulse P = diag(A) v."""
    added = np.array([20.0, 30.0, 40.0])
    bare, model = plain(), plain({"munk_moment": factors})
    for v in np.random.default_rng(2).normal(size=(20, 3)):
        nu = torch.tensor([*v, 0.0, 0.0, 0.0])
        ideal = np.cross(added * v, v)
        found = (model(level, nu, still) - bare(level, nu, still)).detach().numpy()[3:] * [3, 4.5, 6.5]
        expected = [0, (factors["pitch"] - 1) * ideal[1], (factors["yaw"] - 1) * ideal[2]]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
        assert bare(level, nu, still)[5].item() == pytest.approx(ideal[2] / 6.5)


def test_a_factor_of_zero_leaves_no_moment_at_an_angle_to_the_flow(plain, level, still, vector):
    rate = plain({"munk_moment": {"pitch": 0.0, "yaw": 0.0}})(level, vector(1.0, 0.4, 0, 0, 0, 0), still)
    assert rate.abs().max().item() < 1e-15
