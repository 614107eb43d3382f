"""Body lift: against a force on a lever aft, whose moments are r x f, and Prestero's signs."""

from __future__ import annotations

import numpy as np
import torch

INERTIA = np.array([70, 80, 90, 3, 4.5, 6.5])


def test_lift_aft_of_the_origin_gives_the_moments_of_its_lever(plain, level, still):
    k, aft = 9.0, 0.35
    values = {"Yuv": -k, "Zuw": -k, "Muw": -k * aft, "Nuv": k * aft}
    bare, model = plain(), plain({"body_lift": values})
    for v in np.random.default_rng(1).normal(size=(20, 3)):
        nu = torch.tensor([*v, 0.1, -0.2, 0.3])
        force = np.array([0.0, -k * v[0] * v[1], -k * v[0] * v[2]])
        expected = np.concatenate([force, np.cross([-aft, 0, 0], force)]) / INERTIA
        found = (model(level, nu, still) - bare(level, nu, still)).detach().numpy()
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-13)


def test_it_works_against_the_munk_moment(plain, level, still, vector):
    """Moving ahead and down with the bow level the ideal moment lifts the bow, lift aft lowers it."""
    ahead = vector(1.0, 0, 0.2, 0, 0, 0)
    munk = plain()(level, ahead, still)[4].item()
    lift = plain({"body_lift": {"Muw": -4.47}})(level, ahead, still)[4].item() - munk
    assert munk > 0 > lift
