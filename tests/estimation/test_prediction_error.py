"""Multiple shooting against scipy, closed forms, and hidden values."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from auvnn.estimation import prediction_error
from auvnn.estimation.prediction_error import Fitted, fit
from auvnn.estimation.priors import Priors, bounded_step, parameters_of, set_parameters
from auvnn.estimation.window_simulation import output_error
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle
from tests.estimation.bare_statistics import bare_statistics
from tests.small_logs import NOISE, make_log, small_vehicle

HIDDEN = {
    "ocean_current": {"v_north": 0.12, "v_east": -0.08, "v_down": 0.03},
    "net_buoyancy": {"force": 6.0},
    "thruster_lag": {"time_constant": 0.15},
    "linear_damping": {"X": 1.3, "Y": 0.8, "Z": 1.2, "K": 0.7, "M": 1.4, "N": 0.9},
}


def free_priors(model, names, precision=1e-9):
    count = sum(len(model.effect(n).parameters_of) for n in names)
    return Priors(np.zeros(count), np.full(count, precision))


def test_hidden_values_are_found_to_a_thousandth_without_noise():
    truth = GreyBox(small_vehicle()).with_effects(HIDDEN)
    windows = cut_windows(make_log(truth, runs=2, duration=12.0, rate=20.0), 2.0, warmup=1.0)
    model = GreyBox(small_vehicle()).with_effects(list(HIDDEN))
    found = fit(model, windows, list(HIDDEN), free_priors(model, HIDDEN))
    expected = parameters_of(truth, list(HIDDEN))
    scale = np.abs(expected - parameters_of(model, list(HIDDEN)))
    assert found.converged
    assert (np.abs(found.theta - expected) <= 1e-3 * np.maximum(scale, np.abs(expected))).all()
    np.testing.assert_array_equal(parameters_of(found.model, list(HIDDEN)), found.theta)
    assert not parameters_of(model, ["ocean_current", "net_buoyancy", "thruster_lag"]).any(), (
        "the model was changed"
    )


@pytest.fixture(scope="module")
def noisy():
    """A truth with noise, and what was found in it."""
    hidden = {n: HIDDEN[n] for n in ("ocean_current", "net_buoyancy", "linear_damping")}
    truth = GreyBox(small_vehicle()).with_effects(hidden)
    windows = cut_windows(make_log(truth, runs=2, duration=20.0, rate=10.0, noise=1.0), 2.5)
    model = GreyBox(small_vehicle()).with_effects(list(hidden))
    return truth, windows, fit(model, windows, list(hidden), free_priors(model, hidden))


def test_a_fit_that_is_still_falling_goes_on_beyond_its_steps_and_one_that_creeps_does_not(noisy):
    """From far away two steps do not suffice, and where they end says nothing of the effect."""
    _, windows, found = noisy
    names = list(found.names)
    far = GreyBox(small_vehicle()).with_effects(
        {
            "ocean_current": {"v_north": 1.5, "v_east": 1.2},
            "net_buoyancy": {"force": -80.0},
            "linear_damping": dict.fromkeys("XYZKMN", 9.0),
        }
    )
    priors = free_priors(far, names)
    again = fit(far, windows, names, priors, initial=found.initial, sigma=found.sigma, iterations=2)
    long = fit(far, windows, names, priors, initial=found.initial, sigma=found.sigma, iterations=50)
    assert 2 < again.iterations <= prediction_error.PATIENCE * 2
    assert again.cost == pytest.approx(long.cost, rel=0.02)
    near = fit(found.model, windows, names, priors, initial=found.initial, sigma=found.sigma, iterations=2)
    assert near.iterations <= 2


def test_hidden_values_are_found_within_their_standard_errors(noisy):
    truth, _, found = noisy
    std = np.sqrt(np.diag(found.covariance()))
    z = (found.theta - parameters_of(truth, found.names)) / std
    assert (np.abs(z) < 4).all() and 0.3 < np.sqrt(np.mean(z**2)) < 2.0
    assert (std[:4] < [0.02, 0.02, 0.02, 1.0]).all()


def test_the_weights_come_out_as_the_noise_of_each_channel(noisy):
    _, _, found = noisy
    expected = np.array([NOISE["position"]] * 3 + [NOISE["attitude"]] * 3 + [NOISE["nu"]] * 6)
    np.testing.assert_allclose(found.sigma[:12], expected, rtol=0.2)
    assert np.isinf(found.sigma[12:]).all()
    np.testing.assert_allclose(found.statistics.noise()[:12], expected, rtol=0.2)


def test_a_fit_equals_scipys_over_parameters_and_initial_states():
    names = ["net_buoyancy", "ocean_current"]
    truth = GreyBox(small_vehicle()).with_effects(
        {"net_buoyancy": {"force": 8.0}, "ocean_current": {"v_east": 0.1}}
    )
    windows = cut_windows(make_log(truth, runs=1, duration=1.7, rate=20.0, noise=3.0), 0.8)
    model = GreyBox(small_vehicle()).with_effects(names)
    sigma = np.where(np.arange(18) < 12, np.linspace(0.01, 0.03, 18), np.inf)
    held = Priors(np.array([5.0, 0, 0, 0]), np.array([1 / 4.0, 30.0, 30.0, 30.0]))
    found = fit(model, windows, names, held, sigma=sigma, iterations=25)
    start, other = initial_states(model, windows), model.rebuilt(model.copied_effects())
    assert len(windows) == 2

    def residuals(x):
        return many(x[None])[0]

    def many(x):
        """Return residuals of several points with the same parameters, in one free run."""
        set_parameters(other, names, x[0, :4])
        state = moved(start.repeat(len(x), 1), torch.tensor(x[:, 4:].reshape(-1, 12)))
        e = output_error(other, windows.pick(np.tile([0, 1], len(x))), state).numpy()[..., :12] / sigma[:12]
        prior = np.tile(np.sqrt(held.precision) * (x[0, :4] - held.mean), (len(x), 1))
        return np.concatenate([e.reshape(len(x), -1), prior], axis=1)

    def slopes(x):
        ahead, back = many(x + 1e-5 * np.eye(28)[4:]), many(x - 1e-5 * np.eye(28)[4:])
        steps = np.diag([1e-3, 1e-4, 1e-4, 1e-4])
        first = [
            (residuals(x + np.pad(h, (0, 24))) - residuals(x - np.pad(h, (0, 24)))) / (2 * h.sum())
            for h in steps
        ]
        return np.concatenate([np.array(first), (ahead - back) / 2e-5]).T

    best = least_squares(
        residuals,
        np.zeros(28),
        slopes,
        xtol=1e-10,
        ftol=1e-12,
        x_scale=np.concatenate([[5, 0.1, 0.1, 0.1], np.full(24, 0.02)]),
    )
    std = np.sqrt(np.diag(found.covariance()))
    assert (np.abs(found.theta - best.x[:4]) < 0.1 * std).all()
    assert found.cost == pytest.approx(2 * best.cost, rel=1e-4)
    states = moved(start, torch.tensor(best.x[4:].reshape(2, 12)))
    np.testing.assert_allclose(found.initial, states, atol=1e-3)
    dense = np.linalg.inv(best.jac.T @ best.jac)[:4, :4]
    np.testing.assert_allclose(np.sqrt(np.diag(dense)), std, rtol=0.02)


@pytest.mark.parametrize("precision", [0.0, 0.04, 4.0])
def test_a_prior_pulls_as_the_conjugate_formula_says(precision):
    """A constant push on 70 kg without drag: u = u_0 + X t / m, linear in what is fitted."""
    t, random, sigma = np.arange(0, 2.01, 0.1), np.random.default_rng(4), 0.05
    nu = np.zeros((len(t), 6))
    nu[:, 0] = 0.2 + 3.0 * t / 70.0 + sigma * random.normal(size=len(t))
    log = Log.from_runs([Run(0, t, np.tile([1.0, 0, 0, 0], (len(t), 1)), nu, wrench=np.zeros((len(t), 6)))])
    model = GreyBox(plain_vehicle(), actuation="wrench").with_effects(["constant_force"])
    windows = cut_windows(log, 1.0)
    assert len(windows) == 2
    weights = np.full(18, np.inf)
    weights[3:12] = sigma
    mean = np.zeros(6)
    mean[0] = 8.0
    tight = np.full(6, 1e6)
    tight[0] = precision
    found = fit(model, windows, ["constant_force"], Priors(mean, tight), sigma=weights, iterations=30)
    top, bottom = precision * 8.0, precision
    for part in (slice(0, 11), slice(10, 21)):
        x = (t[part] - t[part].mean()) / 70.0
        top += x @ nu[part, 0] / sigma**2
        bottom += x @ x / sigma**2
    assert found.theta[0] == pytest.approx(top / bottom, rel=2e-3)
    assert found.covariance()[0, 0] == pytest.approx(1 / bottom, rel=2e-2)


def test_what_is_hardly_known_does_not_pass_for_well_known_beside_what_is():
    hessian = np.diag([1e16, 0.0])[None]
    sums = bare_statistics(*np.zeros((4, 1, 18)), hessian=hessian)
    model = GreyBox(small_vehicle())
    found = Fitted(
        model,
        (),
        np.zeros(2),
        torch.zeros(1, 13),
        np.ones(18),
        sums,
        Priors(np.zeros(2), np.array([1e-4, 1e-4])),
        0.0,
        True,
        1,
    )
    np.testing.assert_allclose(np.diag(found.covariance()), [1e-16, 1e4], rtol=1e-6)


def test_parameters_are_joined_by_name_and_kept_within_bounds():
    model = GreyBox(small_vehicle()).with_effects(["ocean_current", "thruster_lag"])
    set_parameters(model, ["thruster_lag", "ocean_current"], np.array([-0.3, 0.1, 9.0, -0.2]))
    np.testing.assert_array_equal(
        parameters_of(model, ["ocean_current", "thruster_lag"]), [0.1, 5.0, -0.2, 0.0]
    )
    assert parameters_of(model, []).shape == (0,)


def test_a_lag_that_would_be_negative_ends_at_zero():
    truth = GreyBox(small_vehicle())
    log = make_log(truth, runs=1, duration=8.0, rate=10.0, noise=1.0)
    run = log.runs[0]
    early = np.concatenate([run.thrusters[1:], run.thrusters[-1:]])
    # Commands written down one sample late: a lag would have to run backwards.
    late = Log.from_runs(
        [
            Run(
                0,
                run.t,
                run.quaternion,
                run.nu,
                position=run.position,
                thrusters=np.concatenate([run.thrusters[:1], run.thrusters[:-1]]),
            )
        ]
    )
    ahead = Log.from_runs([Run(0, run.t, run.quaternion, run.nu, position=run.position, thrusters=early)])
    model = truth.with_effects(["thruster_lag"])
    told: list[str] = []
    found = [
        fit(
            model,
            cut_windows(x, 2.0, warmup=1.0),
            ["thruster_lag"],
            free_priors(model, ["thruster_lag"]),
            progress=told.append,
        ).theta[0]
        for x in (late, ahead)
    ]
    assert found[0] == 0.0 and found[1] == pytest.approx(0.1, abs=0.03)
    assert told and told[0].startswith("step 1: error ")


@pytest.mark.parametrize("alike", [0.0, 0.95])
@pytest.mark.parametrize("seed", range(8))
def test_a_bounded_step_is_the_constrained_minimum(seed, alike):
    """By the conditions of Karush, Kuhn and Tucker: no slope within the bounds, none that leads inwards at their ends."""
    random = np.random.default_rng(seed)
    a = alike * random.normal(size=(40, 1)) + (1.0 - alike) * random.normal(size=(40, 12))
    normal, gradient = a.T @ a, a.T @ random.normal(size=40)
    low, high = -random.uniform(0.01, 0.1, 12), random.uniform(0.01, 0.1, 12)
    low[3] = high[3] = 0.0
    step = bounded_step(normal, gradient, low, high)
    slope = (gradient - normal @ step) / np.sqrt(np.diag(normal))
    at_low, at_high = np.isclose(step, low, atol=1e-9), np.isclose(step, high, atol=1e-9)
    assert (step >= low).all() and (step <= high).all() and step[3] == 0.0
    assert at_low.sum() + at_high.sum() > 2
    assert slope[~at_low & ~at_high] == pytest.approx(0.0, abs=1e-7)
    assert (slope[at_high & ~at_low] >= -1e-7).all() and (slope[at_low & ~at_high] <= 1e-7).all()


def test_a_bounded_step_between_wide_bounds_is_that_of_least_squares():
    random = np.random.default_rng(1)
    a, b = random.normal(size=(12, 5)), random.normal(size=12)
    wide = bounded_step(a.T @ a, a.T @ b, np.full(5, -9.0), np.full(5, 9.0))
    assert wide == pytest.approx(np.linalg.lstsq(a, b, rcond=None)[0])


def test_a_bounded_step_of_parameters_that_cannot_move_is_none():
    none, one = np.zeros(2), np.ones(2)
    assert bounded_step(np.eye(2), one, none, none) == pytest.approx(0.0)
    # Out of their ranges, and nothing is said of them: they go to the nearest end.
    assert bounded_step(np.zeros((2, 2)), none, 0.5 * one, one) == pytest.approx(0.5)


def test_a_bounded_step_stays_where_nothing_is_said_of_a_parameter():
    """Two parameters of which only the sum shows, and one that does not show at all."""
    a = np.array([[1.0, 1.0, 0.0]])
    step = bounded_step(a.T @ a, 3.0 * a[0], np.full(3, -1.0), np.full(3, 1.0))
    assert step == pytest.approx([1.0, 1.0, 0.0], abs=1e-9)


def test_a_step_that_is_not_taken_is_run_and_not_differentiated(monkeypatch):
    """And the fit is the same, to the last bit, as one that differentiates every step."""
    truth = GreyBox(small_vehicle()).with_effects({"thruster_lag": {"time_constant": 0.4}})
    model = truth.rebuilt(truth.copied_effects())
    # So far away that the first steps are too long.
    set_parameters(model, ["thruster_lag"], np.array([3.0]))
    windows = cut_windows(make_log(truth, runs=1, duration=8.0, rate=10.0, noise=1.0), 2.0)
    names, priors = ["thruster_lag"], free_priors(model, ["thruster_lag"])
    tried, differentiated = [], []
    run, linear = prediction_error.runs_by_block, prediction_error.linearise

    def counted(at, *given):
        return at.append(1) or (run if at is tried else linear)(*given)

    monkeypatch.setattr(prediction_error, "runs_by_block", lambda *given: counted(tried, *given))
    monkeypatch.setattr(prediction_error, "linearise", lambda *given: counted(differentiated, *given))
    found = fit(model, windows, names, priors, iterations=12)
    assert len(differentiated) == found.iterations + 1 < len(tried)
    monkeypatch.setattr(
        prediction_error, "weights_of", lambda sigma: 0.0 * torch.as_tensor(sigma).nan_to_num()
    )
    every = fit(model, windows, names, priors, iterations=12)
    assert (found.theta == every.theta).all() and found.cost == every.cost
    assert torch.equal(found.initial, every.initial)
