"""Windows with a stochastic force: their covariance against simulated paths, and no force at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.estimation.window_normal_equations import cost_of, linearise, normal_equations
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.free_run import initial_states, predict
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import Wander, path
from tests.small_logs import make_log, small_vehicle

SIGMA = np.array([0.02] * 3 + [0.003] * 3 + [0.004] * 6 + [np.inf] * 6)


@pytest.fixture(scope="module")
def made():
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model, runs=1, duration=24.0, noise=1.0))
    return model, windows, initial_states(model, windows)


def span(windows):
    times = windows.times[:, windows.warmup :]
    return float((times[:, -1] - times[:, 0]).max())


def test_the_covariance_of_outputs_is_that_of_simulated_paths(made):
    model, windows, initial = made
    one = windows.pick(slice(0, 1))
    rms, time = np.array([3.0, 2.0, 4.0, 0.3, 0.3, 0.4]), np.array([0.8, 2.0, 1.0, 3.0, 0.6, 1.5])
    law = ForceLaw(rms, time, 0.25, span(one))
    (answer,) = linearise(model, replace(one, law=law), initial[:1], [])
    columns = answer.force[0].flatten(0, 1).numpy()
    expected = (columns**2).sum(1).reshape(answer.force.shape[1:3])
    # Many windows alike, each moved by a path of its own.
    many, draws = 64, []
    copies = one.pick(np.zeros(many, dtype=int))
    start = initial[:1].expand(many, -1)
    with torch.no_grad():
        still = predict(model, copies, start)[1]
        for seed in range(8):
            paths = np.stack([path(rms, time, 12.0, [7, seed, k]) for k in range(many)], axis=1)
            moved = GreyBox(model.vehicle, [Wander(paths)], None, model.actuation)
            draws.append((predict(moved, copies, start)[1] - still).numpy())
    spread = np.concatenate(draws).std(0)
    for moment in (5, 10, 20):
        got, said = spread[moment], np.sqrt(expected[moment, 6:12])
        assert got == pytest.approx(said, rel=0.15)


def test_sums_are_those_of_the_full_covariance(made):
    model, windows, initial = made
    law = ForceLaw(np.array([3.0, 0, 4.0, 0, 0, 0.4]), np.ones(6), 0.5, span(windows))
    names = ["linear_damping"]
    full = model.with_effects({"linear_damping": {}})
    answers = list(linearise(full, replace(windows, law=law), initial, names))
    sums, _, _ = normal_equations(windows, answers, SIGMA, leverage=True)
    answer, k = answers[0], 1
    weight = 1.0 / SIGMA[:12]
    error = (answer.error[k, :, :12].numpy() * weight).ravel()
    state, force, slope = (
        (x[k].numpy() * weight[:, None]).reshape(len(error), -1)
        for x in (answer.state, answer.force, answer.parameters)
    )
    loose = np.array([10.0] * 3 + [1.0] * 3 + [2.0] * 6)
    covariance = np.eye(len(error)) + force @ force.T + (state * loose**2) @ state.T
    inverse = np.linalg.inv(covariance)
    assert sums.cost[k] == pytest.approx(error @ inverse @ error, rel=1e-6)
    assert sums.slope[k] == pytest.approx(slope.T @ inverse @ error, rel=1e-5)
    assert sums.hessian[k] == pytest.approx(slope.T @ inverse @ slope, rel=1e-5)
    whole = np.linalg.slogdet(covariance)[1] - 2 * np.log(loose).sum()
    assert sums.volume[k] == pytest.approx(whole, rel=1e-6)
    hidden = np.concatenate([state, force], axis=1)
    prior = np.concatenate([loose**-2.0, np.ones(force.shape[1])])
    hat = hidden @ np.linalg.solve(hidden.T @ hidden + np.diag(prior), hidden.T)
    assert sums.spent[k, :12] == pytest.approx(np.diag(hat).reshape(-1, 12).sum(0), rel=1e-5)
    only = np.linalg.inv(np.eye(len(error)) + force @ force.T)
    assert cost_of([answers[0]], SIGMA) > error @ only @ error


def test_a_force_of_no_size_changes_nothing(made):
    model, windows, initial = made
    full = model.with_effects({"linear_damping": {}})
    tiny = ForceLaw(np.full(6, 1e-9), np.ones(6), 0.5, span(windows))
    none, _, _ = normal_equations(windows, linearise(full, windows, initial, ["linear_damping"]), SIGMA)
    some, _, _ = normal_equations(
        windows, linearise(full, replace(windows, law=tiny), initial, ["linear_damping"]), SIGMA
    )
    assert none.volume is None and some.volume is not None
    for name in ("cost", "slope", "hessian", "channel", "rough"):
        assert getattr(some, name) == pytest.approx(getattr(none, name), rel=1e-6, abs=1e-9)
