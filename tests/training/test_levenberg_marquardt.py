"""The default scheme: as good as scipy on the same problem, deterministic, and open about its doubts."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.training.fit_damping import build_scheme, fit_damping
from auvnn.training.least_squares.batched import LeastSquares, Rules
from auvnn.training.least_squares.networks import NetworkProblems
from auvnn.training.problem import DampingProblem
from tests.training.problems import LINEAR, QUADRATIC, law, problem, velocities


def scipy_error(inputs, target, seed, nfev=60):
    """Return the relative error of a 12-5-1 network fitted by scipy from one start."""
    ones = np.column_stack([inputs, np.ones(len(inputs))])
    goal = (target - target.mean()) / target.std()

    def residual(theta):
        return np.tanh(ones @ theta[:65].reshape(5, 13).T) @ theta[65:70] + theta[70] - goal

    def jacobian(theta):
        units = np.tanh(ones @ theta[:65].reshape(5, 13).T)
        slope = (1 - units**2) * theta[65:70]
        inner = (slope[:, :, None] * ones[:, None]).reshape(len(ones), 65)
        return np.column_stack([inner, units, np.ones(len(ones))])

    start = np.random.default_rng(seed).uniform(-0.3, 0.3, 71)
    found = least_squares(residual, start, jacobian, method="trf", max_nfev=nfev)
    return float(np.sqrt(np.mean(found.fun**2)))


def test_it_reaches_what_scipy_reaches_in_as_many_steps():
    made, starts, steps = problem(200), 4, 40
    nu, targets = made.nu.numpy(), made.target.numpy()
    scaled = nu / np.sqrt((nu**2).mean(0))
    inputs = np.column_stack([scaled, np.abs(scaled)])
    rules = Rules(starts, steps, steps, 0.0, 20, 20, 0.3, None)
    goal = torch.tensor((targets - targets.mean(0)) / targets.std(0)).T.contiguous()
    ours = LeastSquares(
        NetworkProblems(torch.tensor(inputs), goal, None, 5),
        None,
        torch.ones(6, dtype=torch.float64),
        rules,
        None,
        torch.Generator().manual_seed(0),
    )
    while ours.running:
        ours.step()
    errors = ours.state["cost"].sqrt().view(starts, 6)[:, [0, 3, 5]].log().mean()
    peer = [
        scipy_error(inputs, targets[:, axis], seed, steps) for seed in range(starts) for axis in (0, 3, 5)
    ]
    assert float(errors) < np.mean(np.log(peer))


def test_what_it_finds_scipy_cannot_improve():
    made = problem(150, noise=0.1)
    bank = DampingBank.from_description({"form": "mlp", "hidden": 1})
    fit = fit_damping(bank, made, scheme={"max_iterations": 300, "restarts": 1, "tolerance": 1e-12})
    form = bank.groups()[0]
    ones = np.column_stack([form.features(made.nu / bank.input_scale).numpy(), np.ones(150)])
    for axis in (0, 4):

        def residual(theta, axis=axis):
            fitted = theta[13] * np.tanh(ones @ theta[:13]) + theta[14]
            return fitted * float(bank.output_scale[axis]) - made.target[:, axis].numpy()

        parts = (form.hidden_weight[axis, 0], form.hidden_bias[axis], form.output_weight[axis])
        start = np.concatenate(
            [p.detach().numpy() for p in parts] + [[float(form.output_bias[axis].detach())]]
        )
        np.testing.assert_allclose(np.sqrt(np.mean(residual(start) ** 2)), fit.rmse[axis], rtol=1e-9)
        polished = least_squares(residual, start, method="lm", xtol=1e-15, ftol=1e-15)
        assert np.sqrt(np.mean(polished.fun**2)) > fit.rmse[axis] * (1 - 1e-4)


def test_the_stated_error_is_the_error_of_the_bank():
    made = problem(300, noise=0.1)
    bank = DampingBank.from_description({"form": "mlp", "each": {"Y": "polynomial", "M": "dissipative"}})
    fit = fit_damping(bank, made, scheme={"max_iterations": 15, "restarts": 1})
    residual = (bank(made.nu) - made.target).detach().numpy()
    np.testing.assert_allclose(fit.rmse, np.sqrt((residual**2).mean(0)), rtol=1e-8)
    np.testing.assert_allclose(fit.relative_rmse, fit.rmse / made.target.numpy().std(0), rtol=1e-8)
    assert fit.iterations == len(fit.history.records) == 15


def test_the_error_never_rises_and_ends_at_the_noise():
    made = problem(600, noise=0.05)
    bank = DampingBank.from_description("mlp")
    fit = fit_damping(bank, made, scheme={"max_iterations": 60, "restarts": 2})
    errors = np.array([record.train for record in fit.history.records])
    assert bool((np.diff(errors, axis=0) <= 0).all())
    truth = law(made.nu.numpy())
    clean = np.sqrt(np.mean((bank(made.nu).detach().numpy() - truth) ** 2, 0)) / truth.std(0)
    assert float(clean.max()) < 0.03 and 0.03 < min(fit.relative_rmse) < max(fit.relative_rmse) < 0.055


def test_weights_decide_which_samples_count():
    nu = velocities(400)
    target = law(nu)
    wrong = target.copy()
    wrong[:100] += 1000.0
    weight = np.ones((400, 6))
    weight[:100] = 1e-9
    weight[100:, 2] = 3.0
    bank = DampingBank.from_description("mlp")
    fit_damping(bank, DampingProblem(nu, wrong, weight), scheme={"max_iterations": 40, "restarts": 1})
    error = bank(torch.tensor(nu[100:])).detach().numpy() - target[100:]
    assert float((np.sqrt((error**2).mean(0)) / target[100:].std(0)).max()) < 0.03


def test_zero_at_rest_stays_so_after_the_fit():
    bank = DampingBank.from_description({"form": "mlp", "zero_at_rest": True})
    fit = fit_damping(bank, problem(300), scheme={"max_iterations": 40})
    assert max(fit.relative_rmse) < 0.02
    assert torch.equal(bank(torch.zeros(6, dtype=torch.float64)), torch.zeros(6, dtype=torch.float64))


def test_dissipative_learns_a_dissipative_law_and_nothing_warns():
    nu = velocities(300)
    made = DampingProblem(nu, nu * (np.diag(LINEAR) + np.diag(QUADRATIC) * np.abs(nu)))
    bank = DampingBank.from_description("dissipative")
    fit = fit_damping(bank, made, scheme={"max_iterations": 30, "restarts": 1})
    assert max(fit.relative_rmse) < 5e-3 and fit.warnings == ()


def test_polynomial_recovers_known_coefficients():
    bank = DampingBank.from_description("polynomial")
    fit = fit_damping(bank, problem(200))
    linear, quadratic = bank.groups()[0].coefficients(bank.input_scale, bank.output_scale)
    np.testing.assert_allclose(linear, LINEAR, atol=1e-8)
    np.testing.assert_allclose(quadratic, QUADRATIC, atol=1e-8)
    assert fit.stopped_because == "solved directly" and fit.iterations == 0 and fit.warnings == ()


def test_the_polynomial_solution_is_weighted():
    made = problem(200, noise=0.3)
    weight = torch.rand(200, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    bank = DampingBank.from_description("polynomial")
    fit_damping(bank, DampingProblem(made.nu, made.target, weight))
    columns = np.column_stack([made.nu, made.nu.abs() * made.nu])
    root = np.sqrt(weight[:, 3].numpy())
    exact = np.linalg.lstsq(columns * root[:, None], made.target[:, 3].numpy() * root, rcond=None)[0]
    linear, quadratic = bank.groups()[0].coefficients(bank.input_scale, bank.output_scale)
    np.testing.assert_allclose(np.concatenate([linear[3], quadratic[3]]), exact, rtol=1e-8)


def test_what_the_data_cannot_tell_apart_is_said():
    nu = velocities(200)
    nu[:, 4] = 0.0  # no pitching at all
    fit = fit_damping(DampingBank.from_description("polynomial"), DampingProblem(nu, law(nu)))
    assert "no motion in q, |q|q" in fit.warnings[0]
    nu = velocities(200)
    nu[:, 3] = 2 * nu[:, 1]  # roll always follows sway
    fit = fit_damping(DampingBank.from_description("polynomial"), DampingProblem(nu, law(nu)))
    assert "v, p, |v|v, |p|p cannot be told apart" in fit.warnings[0] and "rank 10 of 12" in fit.warnings[0]
    nu = velocities(200)
    nu[:, 3] = 2 * nu[:, 1] + 1e-2 * np.random.default_rng(0).standard_normal(200)
    fit = fit_damping(DampingBank.from_description("polynomial"), DampingProblem(nu, law(nu)))
    assert any("correlated" in words and "v and p" in words for words in fit.warnings)


def test_damping_that_adds_energy_is_said_with_its_place():
    nu = velocities(300)
    target = law(nu)
    target[:, 0] = -30.0 * nu[:, 0]
    target[:, 1:] = 0.0
    fit = fit_damping(DampingBank.from_description("polynomial"), DampingProblem(nu, target))
    assert "adds energy at" in fit.warnings[-1] and "nu = (" in fit.warnings[-1]


def test_it_is_deterministic_and_leaves_global_random_numbers_alone():
    made, states = problem(150), []
    for _ in range(2):
        torch.manual_seed(len(states))
        before = torch.get_rng_state()
        bank = DampingBank.from_description("mlp", seed=len(states))
        fit_damping(bank, made, scheme={"max_iterations": 8, "restarts": 3, "halve_every": 3}, seed=4)
        assert torch.equal(torch.get_rng_state(), before)
        states.append(bank.state_dict())
    assert all(torch.equal(states[0][name], states[1][name]) for name in states[0])
    other = DampingBank.from_description("mlp")
    fit_damping(other, made, scheme={"max_iterations": 8, "restarts": 3, "halve_every": 3}, seed=5)
    assert not torch.equal(other.state_dict()["forms.0.output_weight"], states[0]["forms.0.output_weight"])


def test_a_goal_ends_each_axis_when_it_gets_there():
    fit = fit_damping(DampingBank.from_description("mlp"), problem(300), scheme={"goal": 0.05})
    assert fit.stopped_because == "goal reached" and max(fit.relative_rmse) <= 0.05
    assert fit.iterations < 60


def test_held_out_runs_are_not_fitted_and_stop_the_fit():
    made = problem(400, noise=0.5, runs=4)
    bank = DampingBank.from_description({"form": "mlp", "hidden": 10})
    fit = fit_damping(bank, made, held_out=[3], scheme={"patience": 5, "max_iterations": 200})
    assert "held-out runs no longer falls" in fit.stopped_because
    _, held = made.split([3])
    residual = (bank(held.nu) - held.target).detach()
    np.testing.assert_allclose(fit.held_out_rmse, residual.square().mean(0).sqrt(), rtol=1e-8)
    scores = np.array([record.held_out for record in fit.history.records])
    assert bool((np.diff(scores, axis=0) <= 0).all())
    spoiled = made.target.clone()
    spoiled[300:] *= 1e6
    other = DampingBank.from_description({"form": "mlp", "hidden": 10})
    short = {"max_iterations": 1, "restarts": 1}
    fit_damping(other, DampingProblem(made.nu, spoiled, run=made.run), held_out=[3], scheme=short)
    fit_damping(bank, made, held_out=[3], scheme=short)
    torch.testing.assert_close(other.input_scale, bank.input_scale)
    torch.testing.assert_close(other.output_scale, bank.output_scale)


def test_a_warm_start_goes_on_from_the_weights_it_has():
    made, bank = problem(300), DampingBank.from_description("mlp")
    first = fit_damping(bank, made, scheme={"max_iterations": 30, "restarts": 1})
    again = fit_damping(bank, made, scheme={"max_iterations": 5, "restarts": 1}, warm_start=True)
    assert max(np.array(again.relative_rmse) / np.array(first.relative_rmse)) <= 1.0 + 1e-9


def test_single_precision_banks_are_fitted_and_stay_single():
    bank = DampingBank.from_description("mlp").float()
    fit = fit_damping(bank, problem(200), scheme={"max_iterations": 30, "restarts": 1})
    assert all(tensor.dtype == torch.float32 for tensor in bank.state_dict().values())
    assert max(fit.relative_rmse) < 0.05


def test_the_caller_can_watch_and_stop():
    seen = []

    def watch(record):
        seen.append(record.worst)
        return len(seen) == 3

    fit = fit_damping(DampingBank.from_description("mlp"), problem(100), callback=watch)
    assert fit.stopped_because == "stopped by the caller" and fit.iterations == len(seen) == 3


def test_the_bank_is_untouched_if_the_fit_fails():
    bank = DampingBank.from_description("mlp")
    before = {name: tensor.clone() for name, tensor in bank.state_dict().items()}

    def fail(record):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_damping(bank, problem(100), callback=fail)
    assert all(torch.equal(before[name], tensor) for name, tensor in bank.state_dict().items())


@pytest.mark.parametrize(
    ("scheme", "words"),
    [
        ("levenberg", "Did you mean 'levenberg_marquardt'"),
        ({"scheme": "levenberg_marquardt", "restart": 3}, "Did you mean 'restarts'"),
        ({"restarts": 0}, "restarts"),
        ({"goal": -1.0}, "goal"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"scheme": "adam", "learning_rate": 0}, "learning_rate"),
        ({"scheme": "sgd", "schedule": "step"}, "cosine"),
        ({"scheme": "sgd", "momentum": -0.1}, "momentum"),
        ({"scheme": "adam", "batch_size": 2.5}, "batch_size"),
    ],
)
def test_schemes_that_cannot_be_used_are_refused(scheme, words):
    with pytest.raises(ConfigError, match=words):
        build_scheme(scheme)


def test_a_network_too_wide_for_the_scheme_is_sent_to_another():
    bank = DampingBank.from_description({"form": "mlp", "hidden": 300})
    with pytest.raises(ConfigError, match="scheme=adam"):
        fit_damping(bank, problem(50))
