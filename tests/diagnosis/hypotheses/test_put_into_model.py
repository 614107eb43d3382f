"""Fitted coefficients become a vehicle's own numbers, whatever the fit made of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import auvnn
from auvnn.diagnosis.hypotheses.put_into_model import of_a_body, with_body
from auvnn.models import GreyBox


def test_an_inertia_beyond_what_a_body_has_moves_into_the_added_mass_and_no_force_changes():
    """A fit to a slender body scales I_x, I_y and I_z apart: 0.167, 2.76, 3.59 kg m2."""
    model = auvnn.load("remus100", actuation="wrench")
    wild = model.with_effects({"inertia": {"K": 1.01, "M": 0.803, "N": 1.04}})
    body = wild.effect("inertia").body(model.prepare().body, None)
    made = GreyBox(with_body(model.vehicle, body), actuation="wrench")
    low, middle, high = np.linalg.eigvalsh(made.vehicle.inertia)
    assert high == pytest.approx(low + middle, rel=1e-12)
    generator = torch.Generator().manual_seed(0)
    eta = torch.tensor([0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64).expand(50, 7)
    nu = torch.randn(50, 6, generator=generator, dtype=torch.float64)
    command = 10.0 * torch.randn(50, 6, generator=generator, dtype=torch.float64)
    with torch.no_grad():
        assert torch.allclose(made(eta, nu, command), wild(eta, nu, command), rtol=1e-10, atol=1e-12)


def test_an_inertia_that_a_body_has_stays(seed=0):
    generator = np.random.default_rng(seed)
    for _ in range(20):
        # A sum of point masses is a body.
        points = generator.standard_normal((5, 3))
        inertia = sum((p @ p) * np.eye(3) - np.outer(p, p) for p in points)
        added = np.diag(generator.uniform(0.0, 3.0, 6))
        same = of_a_body(inertia, added)
        assert same[0] is inertia and same[1] is added
        turned = inertia + 5.0 * np.trace(inertia) * np.outer(points[0], points[0]) / (points[0] @ points[0])
        one, other = of_a_body(turned, added)
        low, middle, high = np.linalg.eigvalsh(one)
        assert high <= (low + middle) * (1 + 1e-12)
        assert np.allclose(one + other[3:, 3:], turned + added[3:, 3:], rtol=1e-12)
