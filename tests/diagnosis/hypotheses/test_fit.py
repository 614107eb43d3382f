"""Fits judged on what was left out, evidence and standard errors against dense linear algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from auvnn.diagnosis.hypotheses.fit import (
    FOLDS,
    fit_hypothesis,
    folds,
    left_out,
    log_evidence,
    plausible,
)
from auvnn.diagnosis.hypotheses.stated_priors import has_stated_uncertainty, lay_out, priors, scales
from auvnn.diagnosis.selection.predictive_density import (
    cross_validated_log_density,
    improves_predictive_density,
)
from auvnn.logs import Log, Run
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.diagnosis.linear_world import STATED, World, drawn, fitted, layout
from tests.small_logs import make_log, small_vehicle

GROUPS = ["added_mass", "linear_damping", "quadratic_damping", "inertia"]


@pytest.fixture(scope="module")
def world():
    return World.random(layout(), windows=60, strength=12.0, runs=4)


def test_what_is_left_out_is_predicted_by_a_fit_without_it(world):
    errors = drawn(world, 0, ocean_current=np.array([0.2, 0.1, 0.0]))
    found, columns = fitted(world, errors, ["ocean_current"])
    held, fold = found.fitted.priors, world.run
    cost = left_out(found.fitted.statistics, found.fitted.theta, held, fold)
    pull = np.diag(np.sqrt(held.precision))
    for f in range(4):
        keep = fold != f
        j = world.jacobian[keep][..., columns].reshape(-1, len(columns))
        # Free parameters start from their nulls, uncertain ones from what was stated.
        y = np.concatenate([errors[keep].ravel(), pull @ (held.mean - world.means[columns])])
        step = np.linalg.lstsq(np.concatenate([j, pull]), y, rcond=None)[0]
        missed = errors[~keep] - world.jacobian[~keep][..., columns] @ step
        np.testing.assert_allclose(cost[~keep], np.sum(missed**2, 1), rtol=1e-7)
    assert cost.sum() > found.fitted.statistics.cost.sum()


def test_sums_of_free_running_that_diverged_are_refused_without_a_word_on_the_terminal(world, capfd):
    random = np.random.default_rng(1)
    found, _ = fitted(world, world.errors(world.drawn(random), random), ("ocean_current",))
    sums = found.fitted.statistics
    hessian = sums.hessian.copy()
    hessian[3] = np.nan
    with pytest.raises(np.linalg.LinAlgError, match="without bound"):
        left_out(replace(sums, hessian=hessian), found.fitted.theta, found.fitted.priors, world.run)
    assert capfd.readouterr() == ("", "")


def judged(world, errors, effects):
    """Return the explanation with what it leaves on runs left out."""
    found, _ = fitted(world, errors, effects)
    held = plausible(world.layout, found.names, found.effects, found.fitted.priors, found.fitted.theta)
    return replace(
        found, judged=held, left_out=left_out(found.fitted.statistics, found.fitted.theta, held, world.run)
    )


@pytest.mark.parametrize("heard", [range(60), range(45, 60), [50]])
def test_what_one_run_or_one_window_alone_says_of_an_effect_counts(world, heard):
    """Net buoyancy leaves its trace in all windows, in those of the last of four runs, or in one."""
    column = int(world.layout.columns["net_buoyancy"][0])
    trace = np.zeros_like(world.jacobian)
    trace[heard] = world.jacobian[heard] * np.sqrt(60 / len(heard))
    jacobian = world.jacobian.copy()
    jacobian[..., column] = trace[..., column]
    here = World(world.layout, jacobian, world.run)
    size = float(scales(here.layout, "net_buoyancy")[0])
    there, absent = drawn(here, 5, net_buoyancy=size), drawn(here, 5)
    after, before = judged(here, there, ["net_buoyancy"]), judged(here, there, [])
    assert improves_predictive_density(after, before)
    assert not improves_predictive_density(judged(here, absent, ["net_buoyancy"]), judged(here, absent, []))


@pytest.mark.parametrize("effects", [["net_buoyancy", "ocean_current"], []])
def test_what_is_left_out_is_predicted_as_the_joint_density_says(world, effects):
    errors = drawn(world, 3, net_buoyancy=30.0)
    found, columns = fitted(world, errors, effects)
    held = plausible(world.layout, found.names, found.effects, found.fitted.priors, found.fitted.theta)
    found = replace(found, judged=held)
    told = cross_validated_log_density(found)
    assert len(told) == len(errors)
    for run in range(4):
        here = world.run == run
        j = world.jacobian[~here][..., columns].reshape(-1, len(columns))
        covariance = np.linalg.inv(j.T @ j + np.diag(held.precision))
        departure = held.precision * (held.mean - world.means[columns])
        mean = covariance @ (j.T @ errors[~here].ravel() + departure)
        own = world.jacobian[here][..., columns].reshape(-1, len(columns))
        density = multivariate_normal(own @ mean, np.eye(len(own)) + own @ covariance @ own.T)
        expected = -2 * density.logpdf(errors[here].ravel()) - len(own) * np.log(2 * np.pi)
        assert told[here].sum() == pytest.approx(expected, rel=1e-8)


def test_what_a_bound_holds_is_not_credited_with_what_lies_beyond_it(world):
    """A lag cannot be negative, however much better that would predict."""
    errors = drawn(world, 4, thruster_lag=-0.3)
    found, columns = fitted(world, errors, ["thruster_lag"])
    held = plausible(world.layout, found.names, found.effects, found.fitted.priors, found.fitted.theta)
    before, _ = fitted(world, errors, [])
    theta = np.append(before.fitted.theta, 0.0)
    everything = world.means.copy()
    everything[columns] = theta
    sums = world.statistics(errors, everything).columns(columns)
    at_bound = replace(found, judged=held, fitted=replace(found.fitted, theta=theta, statistics=sums))
    assert improves_predictive_density(replace(found, judged=held), before), (
        "beyond its bound it would pay, or this says nothing"
    )
    assert not improves_predictive_density(at_bound, before)
    np.testing.assert_allclose(
        cross_validated_log_density(at_bound), cross_validated_log_density(before), rtol=1e-9
    )


def test_a_window_that_alone_knows_a_parameter_is_not_predicted_from_the_others(world):
    """Elsewhere the effect leaves a fiftieth of its trace: what is fitted to that is noise, several times its size."""
    column = int(world.layout.columns["net_buoyancy"][0])
    jacobian = world.jacobian.copy()
    jacobian[..., column] *= 0.02
    jacobian[50, :, column] = world.jacobian[50, :, column] * np.sqrt(60)
    here, size = World(world.layout, jacobian, world.run), float(scales(world.layout, "net_buoyancy")[0])
    without, plain, kept = 0.0, 0.0, 0.0
    for seed in range(8):
        errors = drawn(here, seed, net_buoyancy=size)
        after = judged(here, errors, ["net_buoyancy"])
        without += judged(here, errors, []).left_out[50]
        kept += after.left_out[50]
        plain += left_out(after.fitted.statistics, after.fitted.theta, after.fitted.priors, here.run)[50]
    assert plain > 3 * without, "or these logs say nothing"
    assert kept < 1.5 * without


def test_nothing_to_fit_leaves_the_error_as_it_is(world):
    sums = world.statistics(drawn(world, 1)).columns([])
    empty = priors(world.layout, [])
    np.testing.assert_allclose(left_out(sums, np.zeros(0), empty, world.run), sums.cost)


def test_folds_are_runs_or_stretches_of_the_only_run():
    def still(number, duration):
        t = np.arange(0, duration + 0.05, 0.1)
        return Run(
            number,
            t,
            np.tile([1.0, 0, 0, 0], (len(t), 1)),
            np.zeros((len(t), 6)),
            wrench=np.zeros((len(t), 6)),
        )

    three = cut_windows(Log.from_runs([still(n, 6.0) for n in range(3)]), 1.0)
    fold = folds(three.run)
    assert len(set(fold)) == 3 and all(len(set(fold[three.run == r])) == 1 for r in (0, 1, 2))
    one = cut_windows(Log.from_runs([still(0, 12.0)]), 1.0)
    fold = folds(one.run)
    assert list(np.unique(fold)) == list(range(FOLDS)) and (np.diff(fold) >= 0).all()
    assert np.bincount(fold).min() >= 2
    many = replace(one, run=np.arange(12))
    assert np.bincount(folds(many.run)).max() <= 3


@pytest.mark.parametrize("effects", [["ocean_current"], ["added_mass"]])
def test_the_evidence_is_the_marginal_likelihood_of_a_linear_world(effects):
    """One constant is common to all explanations, so it is their differences that are compared."""
    world = World.random(layout(), windows=30, samples=10, strength=12.0)
    errors = drawn(world, 2, ocean_current=np.array([0.05, 0.0, 0.05]))

    def exact(asked):
        prior = []
        for name in [*GROUPS, *(e for e in asked if e not in GROUPS)]:
            size = scales(world.layout, name)
            if name in GROUPS and name not in asked:
                size = has_stated_uncertainty(world.layout.model)[name] * np.abs(world.layout.means[name])
            prior.append(size)
        size = np.concatenate(prior)
        columns = world.layout.of([*GROUPS, *(e for e in asked if e not in GROUPS)])
        j = world.jacobian.reshape(-1, world.jacobian.shape[-1])[:, columns]
        return multivariate_normal(cov=np.eye(len(j)) + (j * size**2) @ j.T).logpdf(errors.ravel())

    def found(asked):
        return log_evidence(world.layout, fitted(world, errors, asked)[0], 1.0).evidence

    assert found(effects) - found([]) == pytest.approx(exact(effects) - exact([]), abs=0.15)
    assert has_stated_uncertainty(world.layout.model)["added_mass"] == STATED


def test_an_inflated_variance_divides_what_the_data_say(world):
    errors = drawn(world, 3, ocean_current=np.array([0.3, 0.2, 0.1]))
    with_it, without = fitted(world, errors, ["ocean_current"])[0], fitted(world, errors, [])[0]
    gains = [
        log_evidence(world.layout, with_it, f).evidence - log_evidence(world.layout, without, f).evidence
        for f in (1.0, 4.0)
    ]
    assert gains[0] > 0 and 0.15 < gains[1] / gains[0] < 0.4


def test_priors_hold_what_is_uncertain_and_let_go_what_is_asked_for():
    at = layout(["ocean_current"])
    held = priors(at, ["added_mass", "ocean_current"])
    np.testing.assert_allclose(held.precision[:6], STATED**-2.0)
    np.testing.assert_allclose(held.mean, [1] * 6 + [0] * 3)
    np.testing.assert_allclose(held.precision[6:] ** -0.5, [3.0, 3.0, 1.0])
    freed = priors(at, ["added_mass"], free=["added_mass"])
    np.testing.assert_allclose(freed.precision**-0.5, 10.0)


def test_a_layout_leaves_out_groups_that_the_vehicle_does_not_have_and_keeps_what_the_model_had():
    bare = lay_out(GreyBox(small_vehicle(linear_damping=None)), ["net_buoyancy"])
    assert bare.nuisance == ("added_mass", "quadratic_damping", "inertia")
    model = GreyBox(small_vehicle()).with_effects(
        {"linear_damping": {"X": 1.5}, "net_buoyancy": {"force": 3.0}}
    )
    kept = lay_out(model, ["ocean_current", "net_buoyancy"])
    assert kept.names[:2] == ("linear_damping", "net_buoyancy") and set(kept.names) == {
        *GROUPS,
        "net_buoyancy",
        "ocean_current",
    }
    np.testing.assert_array_equal(kept.means["linear_damping"], [1.5, 1, 1, 1, 1, 1])
    # A stated uncertainty is a share of the value, wherever the value comes from.
    assert priors(kept, ["linear_damping"]).precision[0] == pytest.approx((0.1 * 1.5) ** -2)
    assert model.effect_names == ["linear_damping", "net_buoyancy"]


def test_an_explanation_of_a_real_log_equals_a_refit_without_each_run():
    """The only test here that runs a model: linear prediction of what is left out against fits without it."""
    model = GreyBox(small_vehicle(uncertainty=0.0))
    log = make_log(model.with_effects({"net_buoyancy": {"force": 4.0}}), runs=3, duration=6.0, noise=1.0)
    windows = cut_windows(log, 2.0)
    at = lay_out(model, ["net_buoyancy"])
    found = fit_hypothesis(at, windows, [], ["net_buoyancy"])
    for r in (0, 1, 2):
        keep, out = windows.pick(windows.run != r), windows.pick(windows.run == r)
        refit = fit_hypothesis(at, keep, [], ["net_buoyancy"], sigma=found.fitted.sigma)
        guess = replace(at, model=refit.fitted.model)
        alone = fit_hypothesis(guess, out, [], [], sigma=found.fitted.sigma)
        np.testing.assert_allclose(found.left_out[windows.run == r], alone.fitted.statistics.cost, rtol=0.02)
    assert 0.9 < found.cv < 1.1
