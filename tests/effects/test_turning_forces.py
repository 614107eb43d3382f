"""Turning forces: against products worked out by hand, and what they add to the added mass's own."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects.turning_forces import PRODUCTS

NU = dict(zip("uvwpqr", (0.7, -0.4, 0.3, 0.2, -0.5, 0.9), strict=True))


@pytest.mark.parametrize("name", list(PRODUCTS))
def test_each_coefficient_gives_its_product_on_its_axis(plain, level, still, vector, name):
    nu = vector(*NU.values())
    rate = plain({"turning_forces": {name: 3.0}})(level, nu, still) - plain()(level, nu, still)
    force = (plain().prepare().total @ rate).detach().numpy()
    expected = np.zeros(6)
    expected["XYZKMN".index(name[0])] = 3.0 * NU[name[1]] * NU[name[2]]
    np.testing.assert_allclose(force, expected, atol=1e-12)


def test_in_a_current_only_the_speed_through_the_water_counts(plain, level, still, vector):
    """At rest in the water, drifting with it, there is nothing to turn a force from."""
    drift = {"ocean_current": {"v_north": 0.5, "v_east": 0.2, "v_down": -0.1}}
    nu = vector(0.5, 0.2, -0.1, 0.3, -0.2, 0.4)
    with_them = plain({**drift, "turning_forces": {n: 3.0 for n in PRODUCTS}})(level, nu, still)
    torch.testing.assert_close(with_them, plain(drift)(level, nu, still), atol=1e-13, rtol=0)
