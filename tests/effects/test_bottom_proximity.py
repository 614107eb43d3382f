"""Bottom and surface: against Lamb's forces on a sphere by a wall, by his generalised Lagrange equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

RADIUS = (3 * 490.5 / (1000 * 9.81) / (4 * math.pi)) ** (1 / 3)
ADDED = np.array([20.0, 20.0, 20.0])


def by_lagrange(h, v, strength, exponent):
    """Return dv/dt of a sphere of 50 kg in T = 1/2 m v^2 + 1/2 A (1 + s (R/h)^e) v^2, h = altitude, v NED."""
    f = strength * (RADIUS / h) ** exponent
    slope = -exponent * f / h
    sinking = v[2]
    # d/dt [(m + A + A f) v] = dT/dx, and h falls as it sinks.
    force = ADDED * slope * sinking * v
    force[2] += -0.5 * slope * (ADDED * v * v).sum()
    return force / (50 + ADDED * (1 + f))


@pytest.mark.parametrize("h", [1.2, 2.0, 4.0])
def test_a_sphere_by_the_bottom_moves_as_lamb_says(level, still, h):
    model = GreyBox(plain_vehicle(added_mass=[20.0, 20, 20, 1, 1, 1]), actuation="wrench").with_effects(
        {"bottom_proximity": {"strength": 0.375, "exponent": 3.0}}
    )
    altitude = torch.tensor(h * RADIUS, dtype=torch.float64)
    for v in np.random.default_rng(0).normal(size=(10, 3)):
        nu = torch.tensor([*v, 0.0, 0.0, 0.0])
        found = model(level, nu, still, altitude=altitude).detach().numpy()
        np.testing.assert_allclose(found[:3], by_lagrange(h * RADIUS, v, 0.375, 3.0), rtol=1e-9, atol=1e-13)
        assert np.abs(found[3:]).max() < 1e-12


def test_it_is_sucked_down_when_sliding_and_repelled_when_closing_in(plain, level, still, vector):
    model = plain({"bottom_proximity": {"strength": 0.5}})
    low = torch.tensor(1.5 * RADIUS, dtype=torch.float64)
    assert model(level, vector(1, 0, 0, 0, 0, 0), still, altitude=low)[2] > 0
    assert model(level, vector(0, 0, 1, 0, 0, 0), still, altitude=low)[2] < 0
    assert model(level, vector(0, 0, -1, 0, 0, 0), still, altitude=low)[2] < 0


def test_energy_is_kept_without_drag(plain, vector, still):
    """The surface's twin falls towards its boundary with no energy lost: T grows by nothing."""
    model = GreyBox(plain_vehicle(added_mass=[20.0, 20, 20, 1, 1, 1]), actuation="wrench").with_effects(
        {"surface_proximity": {"strength": 0.4, "exponent": 3.0}}
    )
    times = torch.linspace(0, 3, 301, dtype=torch.float64)
    start = vector(0.5, 0.2, -0.3, 0, 0, 0)
    with torch.no_grad():
        run = model.rollout(
            vector(0, 0, 1.2, 0, 0, 0), start, torch.zeros(301, 6, dtype=torch.float64), times, max_step=0.005
        )
    depth = run.eta[:, 2].numpy()
    assert depth.min() > RADIUS
    mass = 50 + 20 * (1 - 0.4 * (RADIUS / depth) ** 3)
    energy = 0.5 * mass * (run.nu[:, :3].numpy() ** 2).sum(1)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


def test_drag_grows_by_the_same_law(plain, level, vector, still):
    h, drag = 2 * RADIUS, 30.0
    model, bare = (
        plain(
            {"bottom_proximity": {"strength": 0.4, "exponent": 2.0}}, quadratic_damping=[d, 30, 30, 1, 1, 1]
        )
        for d in (drag, 0.0)
    )
    nu, altitude = vector(0.5, 0, 0, 0, 0, 0), torch.tensor(h, dtype=torch.float64)
    change = (model(level, nu, still, altitude=altitude) - bare(level, nu, still, altitude=altitude))[
        0
    ].item()
    assert change == pytest.approx(-drag * 0.25 * 1.1 / (50 + 20 * 1.1))


def test_without_an_altimeter_nothing_happens(plain, level, vector, still):
    nu = vector(0.5, 0, 0.2, 0, 0, 0)
    assert torch.equal(
        plain({"bottom_proximity": {"strength": 0.4}})(level, nu, still), plain()(level, nu, still)
    )
