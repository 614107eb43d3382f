"""One-step fitting against dense least squares, hidden values, and free-running fits of the same log."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.estimation.one_step_error import fit_one_step
from auvnn.estimation.priors import Priors, set_parameters
from auvnn.logs import Log, Run
from auvnn.metrics.derivative import Derivative, choose_derivative
from auvnn.metrics.one_step import accelerations
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

HIDDEN = {
    "net_buoyancy": {"force": 6.0},
    "thruster_lag": {"time_constant": 0.15},
    "velocity_lever_arm": {"x": 0.1, "y": -0.05, "z": 0.04},
    "linear_damping": {"X": 1.3, "Y": 0.8, "Z": 1.2, "K": 0.7, "M": 1.4, "N": 0.9},
}
FILTER = Derivative("local_polynomial", 2, 2)


def loose(model, names):
    count = sum(len(model.effect(n).parameters_of) for n in names)
    return Priors(np.zeros(count), np.full(count, 1e-9))


@pytest.fixture(scope="module")
def plant():
    return GreyBox(small_vehicle()).with_effects(HIDDEN)


@pytest.mark.parametrize("measured", [True, False])
def test_hidden_values_come_back_whichever_hook_they_act_by(plant, measured):
    """Measured accelerations to rounding; those of a filter to what the rows' spacing leaves of the truth."""
    log = make_log(plant, runs=2, duration=8.0, rate=50.0, accelerations=measured)
    # At no lag at all the thrust just after a step is another one: a lag is found from a short one.
    start = GreyBox(small_vehicle()).with_effects(
        {**dict.fromkeys(HIDDEN), "thruster_lag": {"time_constant": 0.05}}
    )
    how = choose_derivative(log) if measured else FILTER
    fitted = fit_one_step(start, log, list(HIDDEN), loose(start, HIDDEN), how)
    truth = np.concatenate([list(v.values()) for v in HIDDEN.values()])
    assert fitted.converged
    np.testing.assert_allclose(
        fitted.theta, truth, rtol=1e-5 if measured else 2e-2, atol=1e-6 if measured else 3e-3
    )


@pytest.fixture(scope="module")
def fitted(plant):
    """A noisy log and one linear effect fitted to it with fixed weights and a prior that is felt."""
    log = make_log(plant, runs=2, duration=6.0, noise=1.0)
    start = GreyBox(small_vehicle()).with_effects(["constant_force"])
    sigma = np.full(18, np.inf)
    sigma[12:] = [0.1, 0.2, 0.1, 0.3, 0.2, 0.1]
    priors = Priors(np.full(6, 0.5), np.array([1.0, 10.0, 0.1, 5.0, 1.0, 2.0]))
    return (
        log,
        start,
        sigma,
        priors,
        fit_one_step(start, log, ["constant_force"], priors, FILTER, sigma=sigma),
    )


def test_a_linear_effect_is_the_dense_least_squares_solution(fitted):
    log, start, sigma, priors, found = fitted

    def error(theta):
        set_parameters(start, ["constant_force"], theta)
        parts = [np.subtract(*accelerations(start, run, FILTER)) for run in log.runs]
        return (np.concatenate(parts) / sigma[12:]).ravel()

    zero = error(np.zeros(6))
    good = np.isfinite(zero)
    columns = np.stack([(zero - error(row))[good] for row in np.eye(6)], axis=1)
    rows = np.concatenate([columns, np.diag(np.sqrt(priors.precision))])
    wanted = np.concatenate([zero[good], np.sqrt(priors.precision) * priors.mean])
    solution, cost, *_ = np.linalg.lstsq(rows, wanted, rcond=None)
    np.testing.assert_allclose(found.theta, solution, rtol=1e-5)
    assert found.cost == pytest.approx(cost[0], rel=1e-7)
    np.testing.assert_allclose(found.statistics.hessian.sum(0), columns.T @ columns, rtol=1e-4, atol=1e-3)


def test_the_sums_of_the_stretches_tell_runs_apart(fitted):
    log, *_, found = fitted
    s = found.statistics
    assert s.run.tolist() == [run.number for run in log.runs for _ in range(2)] and s.first[0] == 0
    # At the optimum data and prior pull equally.
    pull = found.priors.precision * (found.theta - found.priors.mean)
    np.testing.assert_allclose(s.slope.sum(0), pull, rtol=1e-3, atol=1e-3 * np.abs(pull).max())
    assert s.cost.sum() == pytest.approx((s.channel[:, 12:] / found.sigma[12:] ** 2).sum(), rel=1e-9)


def test_the_model_that_is_given_stays_as_it_is(fitted):
    _, start, _, priors, _ = fitted
    before = start.effect("constant_force").values()
    log = make_log(start, runs=1, duration=3.0)
    fit_one_step(start, log, ["constant_force"], priors, FILTER, iterations=1)
    assert start.effect("constant_force").values() == before


def test_a_log_without_a_complete_sample_is_refused(plant):
    run = make_log(plant, runs=1, duration=2.0).runs[0]
    empty = Log.from_runs([Run(1, run.t, run.quaternion, np.full_like(run.nu, np.nan), wrench=run.wrench,
                               thrusters=run.thrusters)], name="blind")  # fmt: skip
    start = GreyBox(small_vehicle()).with_effects(["constant_force"])
    with pytest.raises(InputError, match="blind has no sample"):
        fit_one_step(start, empty, ["constant_force"], loose(start, ["constant_force"]), FILTER)
