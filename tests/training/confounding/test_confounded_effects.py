"""What networks learned that is not damping: silent when they are honest, by name when something hides in them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.answers import plain
from auvnn.damping.bank import DampingBank
from auvnn.metrics.derivative import choose_derivative
from auvnn.models import GreyBox
from auvnn.training import train
from auvnn.training.confounding.confounded_effects import _power, confounded_effects, traces
from auvnn.training.confounding.network_posterior import NetworkPosterior, correlated
from tests.small_logs import make_log, small_vehicle

VEHICLE = small_vehicle()
TRUTH = GreyBox(VEHICLE)
BARE = GreyBox(replace(VEHICLE, linear_damping=None, quadratic_damping=None))


def trained(hidden=None, **how):
    """Train the bare model on a log of the vehicle with something hidden in it."""
    plant = TRUTH.with_effects(hidden) if hidden else TRUTH
    log = make_log(plant, **{"runs": 3, "duration": 20.0, "noise": 1.0, **how})
    return train(BARE, log), log


@pytest.mark.parametrize("accelerations", [True, False])
def test_honest_damping_is_passed_over_in_silence(accelerations):
    found, _ = trained(accelerations=accelerations)
    assert found.absorbed.words() == [] and found.absorbed.named == [] and found.absorbed.at_rest == []
    assert not any("not damping" in w or "at rest" in w or "adds energy" in w for w in found.warnings)


def test_a_constant_force_is_named_with_its_value():
    found, _ = trained({"constant_force": {"X": 6.0, "K": 0.5}}, accelerations=True)
    first = found.absorbed.named[0]
    assert first.effect == "constant_force" and first.share > 0.8
    for name, value in (("X", 6.0), ("K", 0.5)):
        p = first.parameters[name]
        assert abs(p["value"] - value) < 5 * p["std"] < 0.5 * value
    assert found.absorbed.at_rest[0] == 0  # surge
    assert found.absorbed.rest[0] == pytest.approx(-6.0, rel=0.3)
    words = " ".join(found.warnings)
    assert "constant_force (X 6" in words and "push at rest" in words
    answer = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert answer["absorbed"]["named"][0] == "constant_force"


def test_buoyancy_is_named_among_what_it_cannot_be_told_from():
    found, _ = trained({"net_buoyancy": {"force": 6.0}}, runs=4, accelerations=True)
    names = [s.effect for s in found.absorbed.named]
    assert "net_buoyancy" in names
    force = next(s for s in found.absorbed.named if s.effect == "net_buoyancy").parameters["force"]
    assert abs(force["value"] - 6.0) < 5 * force["std"] + 0.6


def test_a_current_on_one_heading_is_named():
    """Without yaw the water's drift is a function of the velocity as good as any."""
    plant = TRUTH.with_effects({"ocean_current": {"v_north": 0.25}})
    t = np.arange(401) / 10
    from tests.small_logs import SIZES, sines

    wrench = SIZES * sines(t, 6, 5) * [1, 1, 1, 0, 0, 0]
    drive = GreyBox(VEHICLE, plant.copied_effects(), None, "wrench")
    parts = [make_log(drive, runs=1, duration=40.0, command=wrench, accelerations=True, stir=0.0, first=0)]
    log = parts[0]
    bare = GreyBox(BARE.vehicle, (), None, "wrench")
    found = train(bare, log)
    assert "ocean_current" in [s.effect for s in found.absorbed.named]
    assert any("ocean_current" in w and "not damping" in w for w in found.warnings)


def test_damping_that_drives_is_told_with_where_and_how_much():
    random = np.random.default_rng(4)
    nu = random.normal(size=(400, 6))
    bank = DampingBank.from_description({"form": "polynomial", "coupled": False})
    with torch.no_grad():
        bank.groups()[0].linear.fill_(20.0)
        bank.groups()[0].linear[1] = -60.0
    truth = nu * [20, -60, 20, 20, 20, 20]
    learned = NetworkPosterior(bank, nu, truth + random.normal(size=nu.shape), np.zeros(400, dtype=int))
    share, (power, where) = _power(learned)
    lost = (nu * truth).sum(1)
    assert share == pytest.approx(np.mean(lost < 0), abs=0.05)
    assert power == pytest.approx(-lost.min()) and np.array_equal(where, nu[lost.argmin()])
    # The same law of which the data leave everything open is not accused.
    assert (
        _power(
            NetworkPosterior(bank, nu, truth + 3e3 * random.normal(size=nu.shape), np.zeros(400, dtype=int))
        )[0]
        == 0
    )


def test_a_model_without_networks_has_learned_nothing():
    log = make_log(TRUTH, runs=1, duration=8.0)
    assert confounded_effects(TRUTH, log) is None
    assert confounded_effects(GreyBox(VEHICLE, (), DampingBank.from_description("zero")), log) is None


def test_traces_are_what_the_effect_does_to_the_target():
    """A constant force is lacking one for one; added mass by its own acceleration and Coriolis terms."""
    log = make_log(TRUTH, runs=1, duration=8.0, accelerations=True)
    trace, described = traces(TRUTH, log, choose_derivative(log), "constant_force")
    np.testing.assert_allclose(trace, np.broadcast_to(-np.eye(6), trace.shape), atol=1e-6)
    assert [p.name for p in described] == list("XYZKMN")
    trace, described = traces(TRUTH, log, choose_derivative(log), "added_mass")
    run, heave = log.runs[0], VEHICLE.added_mass[2, 2]
    np.testing.assert_allclose(trace[:, 2, 2], heave * run.nu_dot[:, 2], rtol=1e-3, atol=1e-3)
    # -C_A nu: added mass in heave pitches by u w.
    np.testing.assert_allclose(trace[:, 4, 2], -heave * run.nu[:, 0] * run.nu[:, 2], rtol=1e-3, atol=1e-3)


def test_standard_errors_of_a_linear_law_are_those_of_least_squares():
    random = np.random.default_rng(1)
    nu = random.normal(size=(500, 6))
    bank = DampingBank.from_description({"form": "polynomial", "coupled": False})
    with torch.no_grad():
        bank.groups()[0].linear.fill_(2.0)
    target = 2.0 * nu + 0.3 * random.normal(size=nu.shape)
    learned = NetworkPosterior(bank, nu, target, np.zeros(500, dtype=int))
    design = np.stack([nu[:, 0], np.abs(nu[:, 0]) * nu[:, 0]], 1)
    at = np.array([1.5, 1.5**2])
    expected = 0.3 * np.sqrt(at @ np.linalg.inv(design.T @ design) @ at)
    _, std = learned.at(np.full((1, 6), 1.5))
    assert std[0, 0] == pytest.approx(expected, rel=0.15)
    assert learned.at(np.zeros((1, 6)))[1].max() < 1e-9  # the law is zero at rest whatever its coefficients


def test_slow_residuals_count_as_fewer():
    random = np.random.default_rng(0)
    white = random.normal(size=(20_000, 1))
    slow = np.zeros_like(white)
    for k in range(1, len(white)):
        slow[k] = 0.8 * slow[k - 1] + white[k]
    run = np.zeros(len(white), dtype=int)
    assert correlated(white, run)[0] == pytest.approx(1.0, abs=0.1)
    assert correlated(slow, run)[0] == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.15)


def test_the_answer_is_plain_data():
    log = make_log(TRUTH, runs=1, duration=8.0, accelerations=True)
    found = confounded_effects(GreyBox(BARE.vehicle, (), DampingBank.from_description("mlp")), log)
    json.dumps(plain(found.to_dict()), allow_nan=False)
    assert len(found.surfaces) == 6
    for curve in found.surfaces:
        low, high = curve["band"]
        assert (
            curve["low"] < curve["high"]
            and (low <= curve["learned"]).all()
            and (curve["learned"] <= high).all()
        )
