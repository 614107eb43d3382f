"""Current shear: against a steady current at one depth, and the push of sinking into faster water."""

from __future__ import annotations

import numpy as np
import torch

DRAG = {"linear_damping": [5, 6, 7, 1, 1, 1], "quadratic_damping": [20, 30, 40, 2, 2, 2]}


def test_at_one_depth_it_is_the_current_there(plain, vector, still):
    shear = plain({"current_shear": {"north": 0.05, "east": -0.02}}, **DRAG)
    for z in (0.0, 4.0, 10.0):
        steady = plain({"ocean_current": {"v_north": 0.05 * z, "v_east": -0.02 * z}}, **DRAG)
        eta, nu = vector(1, 2, z, 0, 0, 0.7), vector(0.3, -0.1, 0, 0, 0, 0.2)
        torch.testing.assert_close(shear(eta, nu, still), steady(eta, nu, still), rtol=1e-12, atol=1e-14)


def test_sinking_into_it_the_added_mass_is_carried_along(plain, vector, still):
    """Relative to the water u_r = u - g z, so that A (u' - g z') is the added mass's share: push A g w / (m + A)."""
    sinking = vector(0.05 * 4, 0, 0.5, 0, 0, 0)
    bare, model = plain(), plain({"current_shear": {"north": 0.05}})
    at = vector(0, 0, 4, 0, 0, 0)
    rate = (model(at, sinking, still) - bare(at, torch.zeros(6).double(), still)).detach().numpy()
    np.testing.assert_allclose(rate[:3], [20 * 0.05 * 0.5 / 70, 0, 0], rtol=1e-12, atol=1e-15)
