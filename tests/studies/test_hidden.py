"""Hidden effects have the size asked for, by a measure that is checked against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import has_stated_uncertainty, lay_out
from auvnn.errors import ConfigError
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import LOOSE
from auvnn.estimation.window_simulation import output_error
from auvnn.metrics.free_run import initial_states, moved
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate
from auvnn.studies.hidden import BEYOND, SIZES, oracle_information, sized

# The contract's realistic noise: x, y, z; roll, pitch, yaw; u, v, w; p, q, r; accelerations are not measured.
SIGMA = np.array([0.05, 0.05, 0.01, 0.003, 0.003, 0.008, *[0.006] * 3, *[0.003] * 3, *[np.inf] * 6])
SHORT = {"runs": 1, "duration": 6.0, "rate": 10.0}
# One parameter, several, one that is bounded below by its null, one that sits in the sensor.
MEASURED = ["net_buoyancy", "ocean_current", "thruster_lag", "velocity_lever_arm"]


@pytest.fixture(scope="module")
def model():
    return load("rov95")


def nulls_and_values(model, name, parameters):
    described = lay_out(model, [name]).model.effect(name).parameters_of
    assert list(parameters) == [p.name for p in described]
    return np.array([p.null for p in described]), np.array([parameters[p.name] for p in described])


def log_of(model, seed, noise="realistic"):
    return simulate(model, "multisine", noise, None, seed, **SHORT).log


@pytest.mark.parametrize("name", MEASURED)
def test_an_effect_is_as_many_standard_errors_away_as_asked(model, name):
    information = oracle_information(model, log_of(model, 3), name, SIGMA)
    for size, errors in {"small": 5.0, "large": 30.0}.items():
        null, value = nulls_and_values(model, name, sized(model, name, size, seed=3, **SHORT))
        assert np.sqrt((value - null) @ information @ (value - null)) == pytest.approx(errors, rel=2e-3)


@pytest.mark.parametrize("name", ["net_buoyancy", "ocean_current", "thruster_gain", "velocity_lever_arm"])
def test_the_information_is_that_of_finite_differences(model, name):
    log = log_of(model, 0, noise="none")
    found = oracle_information(model, log, name, SIGMA)
    weight = np.where(np.isfinite(SIGMA), 1 / SIGMA, 0.0)
    layout = lay_out(model, [name])
    windows = windows_for(model, log)
    begin = initial_states(layout.model, windows)

    def error(theta, change):
        set_parameters(layout.model, [name], theta)
        states = moved(begin, torch.as_tensor(change).expand(len(begin), 12))
        return (output_error(layout.model, windows, states).numpy() * weight).reshape(len(begin), -1)

    effect = layout.model.effect(name)
    null, scale = (np.array([getattr(p, k) for p in effect.parameters_of]) for k in ("null", "scale"))
    still = np.zeros(12)
    parameters, states = [], []
    for step in np.diag(1e-2 * scale):
        parameters.append((error(null + step, still) - error(null - step, still)) / (2 * step.sum()))
    for step in np.diag(np.full(12, 1e-3)):
        states.append((error(null, step) - error(null, -step)) / (2 * step.sum()))
    expected = np.zeros_like(found)
    for s, p in zip(np.stack(states, -1), np.stack(parameters, -1), strict=True):
        cross = s.T @ p
        expected += p.T @ p - cross.T @ np.linalg.solve(s.T @ s + np.diag(LOOSE**-2.0), cross)
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.01 * np.abs(expected).max())


def test_information_grows_as_noise_falls(model):
    log = log_of(model, 0, noise="none")
    coarse, fine = (oracle_information(model, log, "net_buoyancy", s * SIGMA)[0, 0] for s in (2.0, 1.0))
    assert fine == pytest.approx(4 * coarse, rel=1e-3)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["added_mass", "linear_damping", "quadratic_damping"])
def test_a_coefficient_is_off_by_a_multiple_of_what_was_stated(model, name, size):
    factors = np.array(list(sized(model, name, size, seed=5, **SHORT).values()))
    beyond = np.log(factors) / has_stated_uncertainty(model)[name] / BEYOND[size]
    assert np.abs(beyond).max() <= 1.5 + 1e-12
    # A direction of unit rms, which cutting at 1.5 shortens a little.
    assert 0.8 < np.sqrt(np.mean(beyond**2)) <= 1.0 + 1e-12


def test_sizes_of_coefficients_keep_their_order_and_direction(model):
    logs = [np.log(list(sized(model, "added_mass", s, seed=5, **SHORT).values())) for s in BEYOND]
    for small, large, ratio in ((logs[0], logs[1], 4.0 / 2.5), (logs[1], logs[2], 6.0 / 4.0)):
        np.testing.assert_allclose(large, ratio * small, rtol=1e-12)


def test_what_was_not_stated_is_sized_by_the_log(model):
    sure = GreyBox(replace(model.vehicle, uncertainty={}))
    assert "linear_damping" not in has_stated_uncertainty(sure)
    hidden = sized(sure, "linear_damping", "small", seed=1, **SHORT)
    null, value = nulls_and_values(sure, "linear_damping", hidden)
    information = oracle_information(sure, log_of(sure, 1), "linear_damping", SIGMA)
    assert np.sqrt((value - null) @ information @ (value - null)) == pytest.approx(5.0, rel=2e-3)


@pytest.mark.parametrize("name", ["ocean_current", "added_mass"])
def test_the_seed_decides(model, name):
    one, again, other = (sized(model, name, "medium", seed=s, **SHORT) for s in (7, 7, 8))
    assert one == again
    assert one != other


def test_the_noise_of_the_log_does_not_change_the_size(model):
    kinds = [sized(model, "net_buoyancy", "medium", noise=noise, **SHORT) for noise in ("none", "realistic")]
    assert kinds[0] == kinds[1]


def test_an_effect_bounded_by_its_null_is_hidden_on_the_side_that_exists(model):
    for seed in (2, 5):  # whose draws are negative
        assert sized(model, "thruster_lag", "small", seed=seed, **SHORT)["time_constant"] > 0


@pytest.mark.parametrize(
    ("effect", "size", "parts"),
    [
        ("net_buoyancy", "medum", ["'medum'", "'medium'"]),
        ("net_bouyancy", "medium", ["'net_bouyancy'", "'net_buoyancy'"]),
    ],
)
def test_an_unknown_size_or_effect_is_refused_with_its_neighbour(model, effect, size, parts):
    with pytest.raises(ConfigError) as refusal:
        sized(model, effect, size, **SHORT)
    for part in parts:
        assert part in str(refusal.value)
