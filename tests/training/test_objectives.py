"""Training on free running: slopes against differences, gains on held-out runs, and what happens when runs diverge."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError, InputError
from auvnn.estimation.sensitivity import respond
from auvnn.estimation.window_simulation import output_error
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from auvnn.training import train
from auvnn.training.objectives import OBJECTIVES, differentiable
from auvnn.training.objectives.base import Refined, build_objective
from auvnn.training.objectives.differentiable import common_times
from auvnn.training.objectives.shooting import Shooting
from auvnn.training.objectives.weights import get_weights, set_weights
from auvnn.training.objectives.windows import Shots, training_windows
from tests.small_logs import make_log, small_vehicle, thinned

VEHICLE = small_vehicle()
BARE = replace(VEHICLE, linear_damping=None, quadratic_damping=None)
POLYNOMIAL = {"form": "polynomial", "coupled": False}


def learner(share: float = 1.0) -> GreyBox:
    """Return a model whose subnetworks are polynomials, with a share of the true coefficients."""
    bank = DampingBank.from_description(POLYNOMIAL)
    form = bank.groups()[0]
    with torch.no_grad():
        form.linear.copy_(torch.tensor(share * VEHICLE.linear_damping.diagonal().copy())[:, None])
        form.quadratic.copy_(torch.tensor(share * VEHICLE.quadratic_damping.diagonal().copy())[:, None])
    return GreyBox(BARE, (), bank)


@pytest.fixture(scope="module")
def noisy():
    return make_log(GreyBox(VEHICLE), runs=3, duration=10.0, noise=1.0, seed=3)


@pytest.fixture(scope="module")
def clean():
    return make_log(GreyBox(VEHICLE), runs=1, duration=10.0, seed=8)


def test_slopes_of_free_running_by_the_weights_are_those_of_differences():
    fine = make_log(GreyBox(VEHICLE), runs=1, duration=2.0, rate=20.0, seed=8)
    model = GreyBox(BARE, (), DampingBank.from_description("mlp", 1))
    windows = cut_windows(fine, 1.0, kind="thrusters").pick(slice(0, 1))
    initial = initial_states(model, windows)
    answer = respond(model, windows, initial, (), weights=True)
    weights = get_weights(model)
    assert answer.parameters.shape[-1] == len(weights) == 426
    for k in (100, 365, 425):
        step = np.zeros(426)
        step[k] = 1e-4
        errors = []
        for sign in (1, -1):
            set_weights(model, weights + sign * step)
            errors.append(output_error(model, windows, initial))
        slope = ((errors[1] - errors[0]) / 2e-4)[..., :12]
        # Exact up to the square of the time step, as for the effects' parameters.
        assert float((answer.parameters[..., k] - slope).norm()) < 0.07 * float(slope.norm())


def test_the_truth_leaves_nothing_and_stays(clean):
    model = learner()
    before = get_weights(model)
    found = Shooting(window=1.0, iterations=3).refine(model, clean, clean)
    np.testing.assert_allclose(get_weights(found.model), before, rtol=1e-3)
    assert np.array_equal(get_weights(model), before)  # what went in is not changed


@pytest.mark.parametrize("name", ["rollout", "rollout_torchdiffeq"])
def test_a_wrong_law_is_mended_and_free_running_held_out_gains(name, noisy, clean):
    model = learner(0.7)
    few = {"iterations": 3, "prior": 100.0} if name == "rollout" else {"epochs": 10, "learning_rate": 6.0}
    objective = build_objective({"objective": name, "window": 2.0, **few})
    found = objective.refine(model, noisy.select([0, 1]), noisy.select([2]))
    scale = scale_of(clean)
    before, after = (roll(m, clean, "5", scale).total(scale) for m in (model, found.model))
    assert after < before / 2
    assert min(found.held_out) < found.held_out[0] and found.stopped and not found.warnings


def test_least_squares_finds_the_true_coefficients_from_clean_runs(clean):
    found = Shooting(window=2.0, iterations=5, prior=1e3).refine(learner(0.8), clean, clean)
    truth = get_weights(learner())
    np.testing.assert_allclose(get_weights(found.model), truth, rtol=0.02)


def test_initial_states_are_fitted_along(clean):
    """The cost after projecting the initial states out is what a refit of them alone would leave."""
    model = learner(0.9)
    shots = Shots(model, training_windows(model, clean, 2.0))
    _, sigma = shots.settle(model, rounds=3)
    again = shots.sums(model, sigma, weights=True)
    assert again.cost.sum() == pytest.approx(shots.cost(model, shots.initial, sigma), rel=0.02)
    assert again.hessian.shape == (12, 12) and np.linalg.eigvalsh(again.hessian).min() > 0


def test_a_start_that_diverges_is_kept_and_the_reason_told(clean):
    model = learner(-30.0)
    found = Shooting(window=2.0).refine(model, clean, clean)
    assert np.array_equal(get_weights(found.model), get_weights(model))
    assert "diverge" in found.stopped and "one-step fit is the answer" in found.warnings[0]


def test_a_step_that_lets_runs_diverge_is_taken_back(clean, monkeypatch):
    model = learner(0.9)
    weights = get_weights(model)
    monkeypatch.setattr(Shots, "cost", lambda self, m, initial, sigma: np.inf)
    found = Shooting(window=2.0, iterations=3).refine(model, clean, clean)
    assert "no step lowers the error" in found.stopped
    np.testing.assert_array_equal(get_weights(found.model), weights)


@pytest.mark.parametrize("what", ["nan", "explodes"])
def test_a_loss_that_is_lost_ends_with_the_best_weights_and_a_reason(clean, monkeypatch, what):
    real, calls = differentiable._Descent.loss, []

    def loss(self):
        calls.append(1)
        value = real(self)
        return value if len(calls) == 1 else value * (float("nan") if what == "nan" else 1e12)

    monkeypatch.setattr(differentiable._Descent, "loss", loss)
    found = build_objective({"objective": "rollout_torchdiffeq", "window": 2.0, "epochs": 30}).refine(
        learner(0.9), clean, clean
    )
    assert "not finite or exploded 6 times" in found.stopped and len(calls) == 7
    assert np.isfinite(get_weights(found.model)).all()
    np.testing.assert_allclose(get_weights(found.model), get_weights(learner(0.9)))


def test_uneven_times_are_for_the_own_integrator_alone(clean):
    uneven = make_log(GreyBox(VEHICLE), runs=1, duration=8.0, uneven=0.3)
    windows = training_windows(learner(), uneven, 1.0)
    with pytest.raises(InputError, match="objective=rollout"):
        common_times(windows)
    axis, offset = common_times(training_windows(learner(), clean, 1.0))
    np.testing.assert_allclose(np.diff(axis), 0.1, atol=1e-9)
    np.testing.assert_allclose(offset, np.arange(len(offset)) * float(offset[1]), atol=1e-9)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("rolout", "Did you mean 'rollout'"),
        ({"objective": "rollout", "windows": 1}, "Did you mean 'window'"),
        ({"objective": "rollout", "window": -1}, "window"),
        ({"objective": "rollout", "start": "bets"}, "best or given"),
        ({"objective": "rollout_torchdiffeq", "method": "dopri5"}, "rk4"),
        ({"objective": "rollout_torchdiffeq", "epochs": 0}, "epochs"),
    ],
)
def test_what_cannot_be_meant_is_refused(given, words):
    with pytest.raises(ConfigError, match=words):
        build_objective(given)


def test_too_short_a_log_says_so(clean):
    with pytest.raises(InputError, match=r"shorter objective\.window"):
        training_windows(learner(), clean, 4.0)


@pytest.mark.parametrize("name", OBJECTIVES.names())
def test_every_objective_can_be_rebuilt_from_its_options_and_is_a_config(name):
    from auvnn.config import config_dir, read_yaml

    made = build_objective(name)
    assert build_objective({"objective": name, **made.options()}).options() == made.options()
    assert build_objective(read_yaml(config_dir() / "objective" / f"{name}.yaml")).options() == made.options()


def test_train_goes_on_with_rollouts_and_reports_them(noisy):
    """With accelerations as noisy as the paper's, a start on estimated ones is chosen."""
    log = make_log(GreyBox(VEHICLE), runs=3, duration=10.0, noise=0.3, seed=3, accelerations=True)
    random = np.random.default_rng(0)
    loud = copy.copy(log)
    runs = [replace(r, nu_dot=r.nu_dot + 0.5 * random.normal(size=r.nu_dot.shape)) for r in log.runs]
    loud = type(log).from_runs(runs, name="loud")
    found = train(
        GreyBox(BARE),
        loud,
        damping=POLYNOMIAL,
        objective={"objective": "rollout", "window": 2.0, "iterations": 3},
    )
    answer = found.to_dict()
    assert answer["objective"]["objective"] == "rollout"
    assert "estimated from the velocities" in answer["history"]["rollout"]["start"]
    metrics = answer["metrics"]
    one_step, after = (metrics[f"held_out_rollout_5_s_total_{w}"] for w in ("one_step", "after"))
    assert after < one_step / 2


def test_the_default_is_one_step_and_refines_nothing(clean):
    model = learner()
    found = build_objective("one_step").refine(model, clean, clean)
    assert found == Refined(model)


def test_commands_that_change_between_samples_are_trained_so_where_the_model_states_it():
    """A clean log at 5 Hz of commands that change at 25 Hz: with the mean of each interval the true coefficients."""
    truth = make_log(GreyBox(VEHICLE), runs=3, duration=30.0, rate=25.0, max_step=0.04)
    log, path = thinned(truth, 5), CommandPath("smooth", 0.4, 0.2)
    off = []
    for model in (learner(0.8), with_commands(learner(0.8), path)):
        found = Shooting(window=2.0, iterations=5, prior=1e3).refine(model, log, log)
        assert found.model.commands == model.commands
        off.append(np.abs(get_weights(found.model) / get_weights(learner()) - 1.0).max())
    assert off[1] < 0.03 < 0.06 < off[0]


@pytest.mark.parametrize("objective", ["one_step", {"objective": "rollout", "window": 2.0, "iterations": 1}])
def test_a_trained_model_states_what_the_given_one_does(noisy, objective):
    path = CommandPath("linear", 0.5, 0.1)
    given = with_commands(GreyBox(BARE), path)
    few = {"scheme": "levenberg_marquardt", "max_iterations": 3, "restarts": 1}
    assert train(given, noisy, few, POLYNOMIAL, objective=objective).model.commands == path
    assert train(GreyBox(BARE), noisy, few, POLYNOMIAL, objective=objective).model.commands is None
