"""Coriolis forces of the added mass: against impulse and moment of impulse in a turning frame."""

from __future__ import annotations

import numpy as np
import pytest
import torch

# Rigid and added, of the plain vehicle.
MASSES = np.array([70.0, 80.0, 90.0, 3.0, 4.5, 6.5])


@pytest.mark.parametrize("factor", [0.0, 0.4, 1.7])
def test_the_forces_are_those_of_the_impulse_in_a_turning_frame(plain, level, still, factor):
    """Lamb: with impulse P = A v and its moment L = J w, the water asks for w x P and for w x L + v x P."""
    linear, angular = np.array([20.0, 30.0, 40.0]), np.array([1.0, 1.5, 2.5])
    bare, model = plain(), plain({"added_mass_coriolis": {"factor": factor}})
    for nu in np.random.default_rng(4).normal(size=(20, 6)):
        v, w = nu[:3], nu[3:]
        asked = np.concatenate([np.cross(w, linear * v), np.cross(w, angular * w) + np.cross(v, linear * v)])
        gap = (model(level, torch.tensor(nu), still) - bare(level, torch.tensor(nu), still)).detach().numpy()
        np.testing.assert_allclose(gap * MASSES, (1.0 - factor) * asked, rtol=1e-9, atol=1e-12)


def test_it_does_no_work(plain, level, still, vector):
    """nu' C nu = 0 at any factor."""
    nu = vector(1.0, 0.4, -0.3, 0.2, 0.1, -0.5)
    gap = plain({"added_mass_coriolis": {"factor": 0.0}})(level, nu, still) - plain()(level, nu, still)
    assert abs(float((gap * torch.tensor(MASSES)) @ nu)) < 1e-12
