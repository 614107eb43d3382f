"""Compressibility: against Archimedes at two depths, and the period of a float about its neutral depth."""

from __future__ import annotations

import math

import pytest
import torch


def test_buoyancy_is_less_the_deeper(plain, vector, still):
    bare, model = (
        plain(e, center_of_buoyancy=[0.1, 0.0, -0.05])
        for e in (None, {"compressibility": {"per_metre": 2e-3}})
    )
    for depth in (0.0, 5.0, 20.0):
        # 490.5 N of buoyancy balance the weight at the surface; less buoyancy sinks (z is down).
        lost = 490.5 * 2e-3 * depth
        at = (vector(3, 4, depth, 0, 0, 0), still, still)
        rate = model(*at) - bare(*at)
        assert rate[2].item() == pytest.approx(lost / 90, abs=1e-14)
        # Less lift forward of the origin: the bow goes down.
        assert rate[4].item() == pytest.approx(-0.1 * lost / 4.5, abs=1e-12)


def test_a_float_that_stiffens_the_water_swings_about_its_depth(plain, vector, still):
    """With per_metre < 0 buoyancy grows with depth: M z'' = -B |k| (z - z_0), about z_0 where it is neutral."""
    k, neutral = -4e-3, 6.0
    model = plain({"compressibility": {"per_metre": k}}, buoyancy=490.5 / (1 - k * neutral))
    omega = math.sqrt(490.5 / (1 - k * neutral) * -k / 90)
    times = torch.linspace(0, 40, 401, dtype=torch.float64)
    run = model.rollout(vector(0, 0, 7, 0, 0, 0), still, torch.zeros(401, 6, dtype=torch.float64), times)
    for t, eta in zip(times.tolist(), run.eta, strict=True):
        assert eta[2].item() == pytest.approx(neutral + math.cos(omega * t), abs=1e-6)
