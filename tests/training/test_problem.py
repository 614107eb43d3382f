"""What a damping problem accepts, folds into its weights, and refuses."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError, InputError
from auvnn.training.fit_damping import fit_damping
from auvnn.training.problem import DampingProblem
from tests.training.problems import law, problem, velocities


def test_missing_samples_do_not_count():
    nu, weight = velocities(10), np.full((10, 6), 2.0)
    target = law(nu)
    nu[0, 3] = np.nan
    target[1, 2] = np.inf
    weight[2] = 0.0
    valid = np.ones(10, bool)
    valid[3] = False
    made = DampingProblem(nu, target, weight, valid=valid)
    assert made.samples == 7
    assert bool(torch.isfinite(made.nu).all()) and bool(torch.isfinite(made.target).all())
    expected = torch.full((7, 6), 2.0, dtype=torch.float64)
    expected[0, 2] = 0.0
    assert torch.equal(made.weights, expected)


def test_a_bad_sample_changes_nothing_in_the_fit():
    nu = velocities(200)
    target = law(nu)
    bad_nu, bad_target = np.insert(nu, 50, np.nan, axis=0), np.insert(target, 50, 7.0, axis=0)
    banks = [DampingBank.from_description("mlp") for _ in range(2)]
    scheme = {"scheme": "levenberg_marquardt", "max_iterations": 5, "restarts": 1}
    fit_damping(banks[0], DampingProblem(nu, target), scheme=scheme)
    fit_damping(banks[1], DampingProblem(bad_nu, bad_target), scheme=scheme)
    assert torch.equal(banks[0](torch.tensor(nu)), banks[1](torch.tensor(nu)))


def test_the_split_is_by_whole_runs():
    train, held = problem(300, runs=3).split([1])
    assert train.runs == [0, 2] and held.runs == [1]
    assert train.samples + held.samples == 300


def test_the_fingerprint_follows_every_number():
    marks = {problem(50).fingerprint(), problem(50, seed=1).fingerprint(), problem(50, runs=2).fingerprint()}
    marks.add(problem(50, weight=np.array([1.0, 1, 1, 1, 1, 2])).fingerprint())
    assert len(marks) == 4 and problem(50).fingerprint() in marks


def test_the_spread_is_the_weighted_standard_deviation():
    nu = velocities(100)
    doubled = DampingProblem(np.concatenate([nu, nu[:30]]), law(np.concatenate([nu, nu[:30]])))
    weight = np.ones((100, 6))
    weight[:30] = 2.0
    torch.testing.assert_close(DampingProblem(nu, law(nu), weight).spread(), doubled.spread())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"nu": np.zeros((4, 5)), "target": np.zeros((4, 5))}, r"must be \(N, 6\)"),
        ({"nu": np.zeros((4, 6)), "target": np.zeros((5, 6))}, r"must be \(N, 6\)"),
        ({"nu": np.zeros((4, 6)), "target": np.zeros((4, 6)), "weight": np.ones(4)}, "weight has shape"),
        ({"nu": np.zeros((4, 6)), "target": np.zeros((4, 6)), "weight": -np.ones(6)}, "negative"),
        ({"nu": np.zeros((4, 6)), "target": np.zeros((4, 6)), "run": np.zeros(3)}, "run has shape"),
        ({"nu": np.zeros((4, 6)), "target": np.zeros((4, 6)), "valid": np.ones(3)}, "valid has shape"),
        ({"nu": np.full((4, 6), np.nan), "target": np.zeros((4, 6))}, "nothing to fit"),
        ({"nu": [["a"] * 6], "target": np.zeros((1, 6))}, "not an array of numbers"),
    ],
)
def test_what_cannot_be_fitted_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        DampingProblem(**arguments)


def test_runs_that_are_not_there_are_refused():
    made = problem(100, runs=2)
    with pytest.raises(ConfigError, match="names run 7"):
        made.split([7])
    with pytest.raises(ConfigError, match="at least one"):
        made.split([0, 1])


def test_an_axis_without_samples_is_refused_unless_nothing_is_learned_there():
    nu = velocities(100)
    target = law(nu)
    target[:, 3] = np.nan
    with pytest.raises(InputError, match="no usable sample for K"):
        fit_damping(DampingBank.from_description("mlp"), DampingProblem(nu, target))
    bank = DampingBank.from_description({"form": "polynomial", "each": {"K": "zero"}})
    fit = fit_damping(bank, DampingProblem(nu, target))
    assert fit.relative_rmse[0] < 1e-10 and np.isfinite(fit.relative_rmse[3])
