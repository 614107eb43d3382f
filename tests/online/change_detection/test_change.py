"""What kind of change it was: right on simulated changes, unclear where the excitation cannot tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from auvnn.online import Adapter
from auvnn.online.change_detection.change_statistics import Block, fit
from tests.online.online_world import driven, fed, vehicle

CHANGES = {
    "drag": {"quadratic_damping": dict.fromkeys("XYZKMN", 2.0)},
    "mass": {"added_mass": {"X": 1.5, "Y": 1.5, "Z": 1.2}},
    "buoyancy": {"net_buoyancy": {"force": 40.0}},
    "actuator": {"thruster_gain": {"X": 0.6}},
}
EFFECT = {
    "drag": ("quadratic_damping", "X", 2.0),
    "mass": ("added_mass", "Y", 1.5),
    "buoyancy": ("net_buoyancy", "force", 40.0),
    "actuator": ("thruster_gain", "X", 0.6),
}


@pytest.mark.parametrize("kind", list(CHANGES))
def test_the_kind_is_named_with_time_and_size(kind):
    run = driven(
        vehicle(), lambda m: m.with_effects(CHANGES[kind]), when=8.0, duration=20.0, noise=(2e-3, 0.03)
    )
    adapter = Adapter(vehicle())
    fed(adapter, run)
    assert [c.kind for c in adapter.changes] == [kind]
    change = adapter.changes[0]
    effect, parameter, value = EFFECT[kind]
    assert abs(change.time - 8.0) <= 1.0 and change.detected >= change.time
    assert change.effect == effect
    told = change.parameters[parameter]
    # Linearised about the nominal model: a few per cent of a large change are its curvature.
    assert abs(told["value"] - value) < 4 * told["std"] + 0.1 * abs(value)
    assert kind in change.words and change.kinds[0]["kind"] == kind


def test_no_change_is_seen_where_there_is_none():
    run = driven(vehicle(), duration=20.0, noise=(2e-3, 0.05), seed=3)
    adapter = Adapter(vehicle())
    fed(adapter, run)
    assert adapter.changes == []


def test_unclear_where_the_excitation_cannot_tell():
    """At a steady speed, more drag, less thrust and a constant force are one and the same."""
    command = np.tile([80.0, 0.0, 0.0, 0.0, 0.0, 0.0], (251, 1))
    effects = {"thruster_gain": {"X": 0.8}}
    run = driven(vehicle(), lambda m: m.with_effects(effects), when=15.0, command=command, noise=(1e-3, 0.05))
    adapter = Adapter(vehicle())
    fed(adapter, run)
    assert len(adapter.changes) == 1
    change = adapter.changes[0]
    assert change.kind == "unclear" and change.effect is None and change.parameters == {}
    assert "cannot be told" in change.words


def test_a_fit_is_the_bayesian_linear_regression():
    generator = np.random.default_rng(0)
    slopes = generator.standard_normal((40, 6, 3))
    truth, scale = np.array([0.5, -1.0, 0.0]), np.array([1.0, 2.0, 0.5])
    variance = np.array([0.1, 0.2, 0.1, 0.3, 0.1, 0.2])
    missing = slopes @ truth + generator.standard_normal((40, 6)) * np.sqrt(variance)
    hessian, slope, square = Block.of(0.0, slopes, missing).weighted(variance)
    found = fit(hessian, slope, square, scale)
    # The evidence by brute force: the density of all data under both hypotheses.
    rows, y = slopes.reshape(-1, 3), missing.ravel()
    noise = np.tile(variance, 40)
    with_it = stats.multivariate_normal(cov=np.diag(noise) + (rows * scale**2) @ rows.T).logpdf(y)
    without = stats.norm(scale=np.sqrt(noise)).logpdf(y).sum()
    assert found.evidence == pytest.approx(with_it - without, rel=1e-9)
    assert found.left == pytest.approx((((y - rows @ found.theta) ** 2) / noise).sum(), rel=1e-9)
    assert (np.abs(found.theta - truth) < 4 * np.sqrt(np.diag(found.covariance))).all()


def test_taking_a_known_part_out_of_a_block_is_exact():
    generator = np.random.default_rng(1)
    slopes, missing, theta = (
        generator.standard_normal((9, 6, 4)),
        generator.standard_normal((9, 6)),
        np.arange(4.0),
    )
    taken = Block.of(0.0, slopes, missing).without(theta)
    again = Block.of(0.0, slopes, missing - slopes @ theta)
    for name in ("slope", "square", "total"):
        np.testing.assert_allclose(getattr(taken, name), getattr(again, name), rtol=1e-10, atol=1e-10)
