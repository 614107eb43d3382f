"""SGD and Adam: they descend, they can be repeated, and they find back from a loss that is not finite."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.training.fit_damping import fit_damping
from auvnn.training.problem import DampingProblem
from auvnn.training.schemes.adam import Adam
from auvnn.training.schemes.base import Samples, SchemeTask
from tests.training.problems import law, problem, velocities


def task(bank, made, seed=0):
    bank.set_scales(made.nu, made.target)
    return SchemeTask(bank, Samples.scaled(made, bank), None, made.spread() / bank.output_scale, seed, False)


@pytest.mark.parametrize(
    ("scheme", "error"),
    [
        ({"scheme": "adam", "epochs": 80, "learning_rate": 0.04}, 0.25),
        ({"scheme": "adam", "epochs": 30, "batch_size": 32, "schedule": "cosine"}, 0.25),
        ({"scheme": "sgd", "epochs": 20, "batch_size": 16, "learning_rate": 0.01}, 0.25),
    ],
)
@pytest.mark.parametrize(
    "damping", ["mlp", {"form": "dissipative", "each": {"Y": "polynomial", "K": "zero"}}]
)
def test_they_descend_to_what_they_state(scheme, error, damping):
    nu = velocities(300)
    made = DampingProblem(nu, law(nu) if damping == "mlp" else nu * (90.0 + 300.0 * np.abs(nu)))
    bank = DampingBank.from_description(damping)
    fit = fit_damping(bank, made, scheme=scheme)
    residual = (bank(made.nu) - made.target).detach().numpy()
    np.testing.assert_allclose(fit.rmse, np.sqrt((residual**2).mean(0)), rtol=1e-9)
    learned = [axis for axis in range(6) if damping == "mlp" or axis != 3]
    assert max(fit.relative_rmse[axis] for axis in learned) < error
    assert fit.stopped_because == "epoch limit reached"


def test_the_loss_is_the_sum_of_the_relative_squared_errors():
    made, bank = problem(100), DampingBank.from_description("mlp")
    scheme = Adam(epochs=3)
    scheme.begin(task(bank, made))
    loss = float(scheme._loss(slice(None)).detach())
    residual = (bank(made.nu) - made.target).detach().numpy() / made.target.numpy().std(0)
    np.testing.assert_allclose(loss, (residual**2).mean(0).sum(), rtol=1e-10)


def test_the_same_seed_gives_the_same_weights_and_global_numbers_are_left_alone():
    made, states = problem(80), []
    for attempt in range(3):
        torch.manual_seed(attempt)
        before = torch.get_rng_state()
        bank = DampingBank.from_description("mlp")
        fit_damping(bank, made, scheme={"scheme": "sgd", "epochs": 3, "batch_size": 20}, seed=attempt // 2)
        assert torch.equal(torch.get_rng_state(), before)
        states.append(bank.state_dict()["forms.0.hidden_weight"])
    assert torch.equal(states[0], states[1]) and not torch.equal(states[0], states[2])


@pytest.mark.parametrize("name", ["sgd", "adam"])
def test_an_exploding_fit_retreats_stops_with_a_reason_and_keeps_finite_weights(name):
    made, bank = problem(100), DampingBank.from_description("polynomial")
    fit = fit_damping(bank, made, scheme={"scheme": name, "epochs": 200, "learning_rate": 1e200})
    assert "not finite or exploded 10 times" in fit.stopped_because and fit.iterations < 200
    assert all(bool(torch.isfinite(tensor).all()) for tensor in bank.state_dict().values())
    assert all(np.isfinite(record.train).all() for record in fit.history.records)


def test_a_step_too_large_is_halved_until_it_works():
    made = problem(100)
    bank = DampingBank.from_description("polynomial")
    rough = {"scheme": "sgd", "epochs": 400, "learning_rate": 20.0, "momentum": 0.0}
    fit = fit_damping(bank, made, scheme=rough)
    assert fit.stopped_because == "epoch limit reached" and max(fit.relative_rmse) < 0.5


def test_one_loss_that_is_not_finite_costs_one_epoch():
    made, bank = problem(100), DampingBank.from_description("mlp")
    scheme = Adam(epochs=20)
    scheme.begin(task(bank, made))
    for _ in range(5):
        scheme.step()
    best = [tensor.clone() for tensor in scheme._best.values()]
    with torch.no_grad():
        next(iter(scheme._parameters.values())).fill_(torch.nan)
    scheme.step()
    assert all(torch.equal(a, b) for a, b in zip(scheme._parameters.values(), best, strict=True))
    assert scheme._factor == 0.5 and scheme.finished() is None
    scheme.step()
    assert bool(torch.isfinite(scheme.errors()[0]).all())


def test_a_plateau_ends_the_fit():
    nu = np.zeros((50, 6))
    nu[:25] = 0.5
    target = np.where(nu > 0, 1.0, -1.0)
    target[::2] *= -1.0  # contradictory: nothing but the mean can be learned
    bank = DampingBank.from_description("mlp")
    fit = fit_damping(
        bank, DampingProblem(nu, target), scheme={"scheme": "adam", "epochs": 5000, "patience": 20}
    )
    assert fit.stopped_because == "the error has not fallen for 20 epochs" and fit.iterations < 5000


def test_the_best_held_out_weights_are_kept():
    made = problem(200, noise=0.5, runs=2)
    bank = DampingBank.from_description({"form": "mlp", "hidden": 12})
    scheme = {"scheme": "adam", "epochs": 120, "learning_rate": 0.05}
    fit = fit_damping(bank, made, held_out=[1], scheme=scheme)
    _, held = made.split([1])
    residual = (bank(held.nu) - held.target).detach()
    np.testing.assert_allclose(fit.held_out_rmse, residual.square().mean(0).sqrt(), rtol=1e-8)
    scores = [np.mean(np.square(record.held_out)) for record in fit.history.records]
    assert scores == sorted(scores, reverse=True) and scores[-1] < scores[0]


def test_a_bank_without_parameters_has_nothing_to_learn():
    fit = fit_damping(DampingBank.from_description("zero"), problem(50), scheme="adam")
    assert fit.stopped_because == "there is nothing to learn" and fit.iterations == 0
