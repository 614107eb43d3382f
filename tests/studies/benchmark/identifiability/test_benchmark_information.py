"""What a log cannot tell apart: against plain least squares, and against the differences of an independent plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import FREE, lay_out
from auvnn.models import load
from auvnn.simulation import simulate
from auvnn.studies.benchmark.identifiability.information import (
    NONE,
    Information,
    Truth,
    imitation,
    information,
    noise_sigma,
    truth_point,
)
from auvnn.studies.hidden import oracle_information

SHORT = {"runs": 1, "duration": 8.0, "rate": 20.0}
FORCE = {"net_buoyancy": {"force": 12.0}}
RIVALS = ["constant_force", "thruster_lag"]


@pytest.fixture(scope="module")
def model():
    return load("rov95")


@pytest.fixture(scope="module")
def log(model):
    return simulate(model, "multisine", "realistic", FORCE, seed=4, max_step=0.05, **SHORT).log


@pytest.fixture(scope="module")
def point(model, log):
    return truth_point(model, log, Truth(FORCE, {}), RIVALS, "realistic")


@pytest.fixture(scope="module")
def found(point):
    return information(point)


def slopes(total, rng):
    """Return a matrix S with S' S = total up to rounding."""
    values, vectors = np.linalg.eigh(total)
    return (vectors * np.sqrt(np.maximum(values, 0.0))).T


@pytest.mark.parametrize("rival", [NONE, "ocean_current", "thruster_lag"])
@pytest.mark.parametrize("hidden", ["net_buoyancy", "linear_damping"])
def test_the_distance_is_that_of_bounded_least_squares(model, hidden, rival):
    layout = lay_out(model, ["net_buoyancy", "linear_damping", "ocean_current", "thruster_lag"])
    size = sum(map(len, layout.columns.values()))
    rng = np.random.default_rng(3)
    s = rng.normal(size=(3 * size, size)) @ np.diag(np.exp(rng.normal(size=size)))
    # One column nearly imitates another, with the wrong sign: only the bound of a lag keeps it from doing so.
    force, lag = layout.columns["net_buoyancy"][0], layout.columns["thruster_lag"][0]
    s[:, lag] = -0.9 * s[:, force] + 0.1 * s[:, lag]
    values = {"net_buoyancy": {"force": 2.0}, "linear_damping": {"X": 1.5, "N": 0.7}}
    truth = Truth({hidden: values[hidden]}, {})
    given = Information(s.T @ s, layout, {}, truth)

    described = layout.described(hidden)
    away = np.array([truth.hidden[hidden].get(p.name, p.null) - p.null for p in described])
    free = [] if rival == NONE else [rival]
    names = [*free, *layout.nuisance]
    columns = layout.of(names)
    spread, low, high = [], [], []
    for name in names:
        for p in layout.described(name):
            loose = name in free
            spread.append(FREE * p.scale if loose else model.vehicle.uncertainty[name])
            low.append(p.low - p.null if loose else -np.inf)
            high.append(p.high - p.null if loose else np.inf)
    # The prior as further rows of the least squares.
    matrix = np.vstack([s[:, columns], np.diag(1.0 / np.array(spread))])
    target = np.concatenate([s[:, layout.columns[hidden]] @ away, np.zeros(len(columns))])
    best = lsq_linear(matrix, target, (low, high), tol=1e-13)
    assert given.distance(hidden, rival) == pytest.approx(np.sqrt(2 * best.cost), rel=1e-5)


def test_another_hidden_effect_may_follow(model):
    layout = lay_out(model, ["net_buoyancy", "ocean_current", "thruster_lag"])
    size = sum(map(len, layout.columns.values()))
    s = np.random.default_rng(0).normal(size=(2 * size, size))
    one = Information(s.T @ s, layout, {}, Truth({"net_buoyancy": {"force": 2.0}}, {}))
    both = replace(one, truth=Truth({"net_buoyancy": {"force": 2.0}, "ocean_current": {"v_north": 0.3}}, {}))
    # With the current in both explanations it may take other values: as if it were a rival besides nothing.
    assert both.distance("net_buoyancy", NONE) == pytest.approx(one.distance("net_buoyancy", "ocean_current"))
    assert set(imitation(both, ["ocean_current", "thruster_lag"])["net_buoyancy"]) == {NONE, "thruster_lag"}


def test_who_knows_less_is_less_sure(model, log, found):
    sigma = noise_sigma("realistic", windows_for(model, log))
    known = oracle_information(model, log, "net_buoyancy", sigma)
    sure = 12.0 * float(np.sqrt(known[0, 0]))
    alone = found.distance("net_buoyancy", NONE)
    assert 0.3 * sure < alone < sure
    assert all(found.distance("net_buoyancy", rival) <= alone + 1e-9 for rival in RIVALS)


def test_the_distance_grows_with_the_effect(model, log, found):
    twice = replace(found, truth=Truth({"net_buoyancy": {"force": 24.0}}, {}))
    assert twice.distance("net_buoyancy", "thruster_lag") == pytest.approx(
        2 * found.distance("net_buoyancy", "thruster_lag"), rel=1e-3
    )


def test_the_noise_is_that_of_the_condition(model, log):
    windows = windows_for(model, log)
    sigma = noise_sigma("realistic", windows)
    assert sigma[:3] == pytest.approx([0.05, 0.05, 0.01]) and sigma[6:9] == pytest.approx([0.006] * 3)
    assert np.isinf(sigma[12:]).all(), "accelerations were not measured"
    assert (noise_sigma("none", windows)[:12] < sigma[:12]).all()


def test_a_plant_is_asked_only_of_what_it_can_hold_and_windows_can_say():
    from auvnn.studies.benchmark.identifiability.plant_information import covers

    assert covers("numpy", ["net_buoyancy", "constant_force"])
    assert not covers("numpy", ["net_buoyancy", "thruster_lag"]), "it remembers commands from before a window"
    # A current is confusable with one that grows with depth, which the engine has not got.
    assert not any(covers("numpy", [n]) for n in ("propeller_lag", "thrust_overshoot", "fin_lag", "waves"))
    assert covers("numpy", ["ocean_current", "current_shear"])
    pytest.importorskip("mujoco")
    assert covers("mujoco", ["ocean_current"]) and not covers("mujoco", ["ocean_current", "current_shear"])


@pytest.mark.long
def test_an_independent_plant_holds_the_same_information(model, point, found):
    pytest.importorskip("auvnn.plants")
    from auvnn.studies.benchmark.identifiability.plant_information import plant_information

    names = ["net_buoyancy", "constant_force"]
    theirs = plant_information("numpy", model, point, names)
    for rival in (NONE, "constant_force"):
        assert theirs.distance("net_buoyancy", rival) == pytest.approx(
            found.distance("net_buoyancy", rival), rel=0.03
        )
