"""The payload: what the cylinder adds, against sums over its parts, and momentum kept at the grasp."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.models import GreyBox, load
from auvnn.models.structures.base import without_damping
from auvnn.studies.paper.cylinder import Cylinder, factored, grasp, with_cylinder

DESCRIBED = {"diameter": 0.25, "position": [0.1, -0.05, 0.35], "axis": [0.0, 1.0, 0.0], "net_weight": 0.0}


def cylinder(**changes) -> Cylinder:
    return Cylinder.build(60.0, {**DESCRIBED, **changes}, 1000.0, 9.81)


def points_of(c: Cylinder, count: int = 200_000) -> np.ndarray:
    random = np.random.default_rng(0)
    along = c.length * (random.uniform(size=count) - 0.5)
    radius, angle = (
        0.5 * c.diameter * np.sqrt(random.uniform(size=count)),
        2 * math.pi * random.uniform(size=count),
    )
    return c.position + np.stack([along, radius * np.cos(angle), radius * np.sin(angle)], -1) @ c.axes.T


def test_it_displaces_its_own_mass_where_it_is_neutral():
    c = cylinder()
    assert 1000.0 * math.pi * c.diameter**2 / 4 * c.length == pytest.approx(60.0)
    heavy = cylinder(net_weight=98.1)
    assert 1000.0 * math.pi * heavy.diameter**2 / 4 * heavy.length == pytest.approx(50.0)


def test_mass_centre_and_inertia_are_those_of_its_parts():
    vehicle = load("rov95").vehicle
    c, axis = cylinder(), np.array([1.0, 2.0, -0.5])
    c = cylinder(axis=axis.tolist())
    np.testing.assert_allclose(np.cross(c.axes[:, 0], axis), 0, atol=1e-12)
    np.testing.assert_allclose(c.axes.T @ c.axes, np.eye(3), atol=1e-12)
    loaded, points = with_cylinder(vehicle, c), points_of(c)
    assert loaded.mass == 155.0
    np.testing.assert_allclose(loaded.center_of_gravity, 60.0 * c.position / 155.0)
    # Monte Carlo over the cylinder, the vehicle as a separate body.
    arms = points - loaded.center_of_gravity
    own = 60.0 * (np.mean(np.sum(arms**2, -1)) * np.eye(3) - np.einsum("ni,nj->ij", arms, arms) / len(arms))
    arm = vehicle.center_of_gravity - loaded.center_of_gravity
    rest = vehicle.inertia + 95.0 * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    np.testing.assert_allclose(loaded.inertia, own + rest, atol=0.03)


def test_a_neutral_cylinder_does_not_change_weight_less_buoyancy_nor_its_moment():
    vehicle = load("rov95").vehicle
    loaded = with_cylinder(vehicle, cylinder())
    g = vehicle.gravity
    assert loaded.mass * g - loaded.buoyancy == pytest.approx(vehicle.mass * g - vehicle.buoyancy, abs=1e-9)
    moment = [v.mass * g * v.center_of_gravity - v.buoyancy * v.center_of_buoyancy for v in (vehicle, loaded)]
    np.testing.assert_allclose(*moment, atol=1e-9)


def test_its_drag_is_the_sum_over_strips():
    c = cylinder()
    element = c.drag(1000.0)
    x = (np.arange(20_000) + 0.5) / 20_000 * c.length - 0.5 * c.length
    strip = 0.5 * 1000.0 * 0.8 * c.diameter * c.length / len(x)
    assert element.quadratic[1] == pytest.approx(strip * len(x))
    assert element.quadratic[4] == pytest.approx(strip * np.sum(np.abs(x) ** 3), rel=1e-6)


@pytest.mark.parametrize("axis", [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.5, -0.7]])
def test_momentum_is_kept_at_the_grasp_and_energy_is_lost(axis):
    empty = GreyBox(without_damping(load("rov95").vehicle), actuation="wrench")
    c = cylinder(axis=axis)
    after = GreyBox(with_cylinder(empty.vehicle, c), actuation="wrench")
    jump = grasp(empty, c)
    m0, m1 = (m.prepare().total.numpy() for m in (empty, after))
    nu = np.array([0.3, -0.2, 0.1, 0.2, -0.1, 0.3])
    np.testing.assert_allclose(m1 @ (jump @ nu), m0 @ nu, rtol=1e-10)
    assert (jump @ nu) @ m1 @ (jump @ nu) < nu @ m0 @ nu


def test_the_jump_is_as_large_as_the_references_say():
    """Of a 90 kg vehicle: surge times 0.55 held across, times 0.70 along; of masses, nearly those of ours."""
    empty = GreyBox(without_damping(load("rov90").vehicle), actuation="wrench")
    at = {"position": [0.0, 0.0, 0.0]}
    assert grasp(empty, cylinder(axis=[0, 1, 0], **at))[0, 0] == pytest.approx(0.55, abs=0.01)
    assert grasp(empty, cylinder(axis=[1, 0, 0], **at))[0, 0] == pytest.approx(0.70, abs=0.01)


def test_factors_span_their_range_and_keep_the_drag_dissipative():
    vehicle = load("rov95").vehicle
    loaded, factors = factored(vehicle, 1.5, 10.0, np.random.default_rng(3))
    assert min(factors) == pytest.approx(1.5) and max(factors) == pytest.approx(10.0) and len(factors) == 12
    before, after = vehicle.damping_elements[0], loaded.damping_elements[0]
    np.testing.assert_allclose(
        np.concatenate([after.linear / before.linear, after.quadratic / before.quadratic]), factors
    )
    matrix = load("rov90").vehicle
    changed, _ = factored(matrix, 1.5, 10.0, np.random.default_rng(3))
    assert (np.linalg.eigvalsh(changed.linear_damping) > 0).all()
    nu = torch.randn(50, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    from auvnn.studies.paper.curves import drag

    assert bool(((drag(GreyBox(loaded, actuation="wrench"), nu) * nu).sum(-1) > 0).all())


def test_what_is_no_body_is_refused():
    with pytest.raises(ConfigError, match="not a body"):
        cylinder(net_weight=1000.0)
    with pytest.raises(ConfigError, match="axis is not zero"):
        cylinder(axis=[0.0, 0.0, 0.0])
    with pytest.raises(ConfigError, match="no range"):
        factored(load("rov95").vehicle, 3.0, 2.0, np.random.default_rng(0))
