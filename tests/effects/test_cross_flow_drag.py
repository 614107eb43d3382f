"""Cross-flow drag: against the strip integral, worked out by quadrature and by hand for pure yaw."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.integrate import quad

DRAG = [10.0, 60.0, 80.0, 1.0, 2.0, 3.0]
INERTIA = np.array([70, 80, 90, 3, 4.5, 6.5])


def strips(v, w, q, r, length=1.0):
    def at(x, which):
        side, sink = v + x * r, w - x * q
        speed = np.hypot(side, sink)
        return {"Y": -60 * speed * side, "Z": -80 * speed * sink,
                "M": 80 * x * speed * sink, "N": -60 * x * speed * side}[which] / length  # fmt: skip

    half = length / 2
    return np.array([quad(at, -half, half, args=(k,), epsabs=1e-12)[0] for k in "YZMN"])


def test_share_one_is_the_strip_integral_instead_of_the_centre(plain, level, still):
    bare, model = (plain(e, quadratic_damping=DRAG) for e in (None, {"cross_flow_drag": {"share": 1.0}}))
    for v, w, q, r in np.random.default_rng(3).uniform(0.4, 1, size=(10, 4)) * [1, -1, 0.3, 0.5]:
        nu = torch.tensor([0.5, v, w, 0.0, q, r])
        change = (model(level, nu, still) - bare(level, nu, still)).detach().numpy() * INERTIA
        y, z, m, n = strips(v, w, q, r)
        expected = [0, y + 60 * abs(v) * v, z + 80 * abs(w) * w, 0, m, n]
        np.testing.assert_allclose(change, expected, rtol=1e-6, atol=1e-6)


def test_pure_sway_stays_and_pure_yaw_gets_a_moment(plain, level, still, vector):
    """N = -Y r |r| / L times the integral of |x|^3 over the hull, L^3/32."""
    bare, model = (plain(e, quadratic_damping=DRAG) for e in (None, {"cross_flow_drag": {"share": 1.0}}))
    sway, yaw = vector(0, 0.6, 0, 0, 0, 0), vector(0, 0, 0, 0, 0, 0.6)
    torch.testing.assert_close(model(level, sway, still), bare(level, sway, still), rtol=1e-12, atol=1e-13)
    change = (model(level, yaw, still) - bare(level, yaw, still))[5].item() * 6.5
    assert change == pytest.approx(-60 * 0.36 / 32, rel=0.01)
