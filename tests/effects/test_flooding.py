"""Flooding: against a rocket's equation run backwards, and a falling body that grows heavier."""

from __future__ import annotations

import math

import pytest
import torch


def test_a_drifting_body_that_takes_in_water_keeps_its_momentum(plain, level, vector):
    """(m + A + q t) u is conserved where nothing pushes, not even weight: the water was at rest."""
    rate = 2.0
    model = plain({"flooding": {"rate": rate}}, gravity=1e-12, buoyancy=50e-12)
    times = torch.linspace(0, 10, 101, dtype=torch.float64)
    run = model.rollout(level, vector(0.9, 0, 0, 0, 0, 0), torch.zeros(101, 6, dtype=torch.float64), times)
    for t, nu in zip(times.tolist(), run.nu, strict=True):
        assert nu[0].item() == pytest.approx(0.9 * 70 / (70 + rate * t), rel=1e-7)


def test_it_sinks_under_the_weight_of_the_water(plain, level, still):
    """d/dt [(M + q t) w] = q g t gives w = q g t^2 / 2 (M + q t), M with added mass."""
    rate = 0.5
    model = plain({"flooding": {"rate": rate}})
    times = torch.linspace(0, 8, 81, dtype=torch.float64)
    run = model.rollout(level, still, torch.zeros(81, 6, dtype=torch.float64), times)
    for t, nu in zip(times.tolist(), run.nu, strict=True):
        assert nu[2].item() == pytest.approx(rate * 9.81 * t * t / 2 / (90 + rate * t), rel=1e-6, abs=1e-12)


def test_the_water_is_carried_at_the_centre_of_gravity(plain, vector, still):
    """Pitched up, the added weight at r_g turns the vehicle by r_g x R' [0 0 q t g]."""
    cg = [0.1, 0.0, 0.05]
    model, bare = (
        plain(e, center_of_gravity=cg, added_mass=[1e9] * 6) for e in ({"flooding": {"rate": 0.3}}, None)
    )
    theta, t = 0.4, 20.0
    at = (vector(0, 0, 5, 0, theta, 0), still, still)
    change = (model(*at, time=t) - bare(*at, time=t)) * 1e9
    weight = 0.3 * t * 9.81
    down = (-math.sin(theta) * weight, 0.0, math.cos(theta) * weight)
    expected = [*down, 0.0, cg[2] * down[0] - cg[0] * down[2], 0.0]
    # The other numbers of the enormous body differ in the ninth digit.
    assert change.tolist() == pytest.approx(expected, rel=1e-5, abs=1e-5)
