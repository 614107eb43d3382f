"""The test at the null, on linear worlds where chance is known: no model is run here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.stats import kstest

from auvnn.diagnosis.hypotheses.stated_priors import priors
from auvnn.diagnosis.score_tests.few_windows import freedom
from auvnn.diagnosis.score_tests.score import project, score, similarity
from auvnn.diagnosis.score_tests.variance_inflation import inverse_root, share_left, variance_inflation
from auvnn.estimation.window_sums.sufficient_statistics import InformationShares, ScoreMoments
from tests.diagnosis.linear_world import STATED, World, layout

DRAWS = 300
GROUPS = ["added_mass", "linear_damping", "quadratic_damping", "inertia"]


@pytest.fixture(scope="module")
def world():
    return World.random(layout(), strength=12.0)


def scored(world, errors, names, base=GROUPS, free=()):
    """Return the scores of several effects at the null, the base fitted to the errors."""
    theta = world.fitted_null(errors, list(base), free)
    at = world.at(theta[world.layout.of(base)], list(base))
    sums = world.statistics(errors, theta)
    return [score(sums, at, base, n, free) for n in names]


def p_values(world, names, seed=2, base=GROUPS, noise=None, draws=DRAWS, **changed):
    """Return the p-values of several effects, (draws, names)."""
    random, out = np.random.default_rng(seed), []
    for _ in range(draws):
        errors = world.errors(world.drawn(random, **changed), random, noise)
        out.append([s.p_value for s in scored(world, errors, names, base)])
    return np.array(out)


@pytest.fixture(scope="module")
def under_the_null(world):
    names = ["ocean_current", "net_buoyancy", "cg_offset", "added_mass"]
    return dict(zip(names, p_values(world, names).T, strict=True))


@pytest.mark.parametrize("name", ["ocean_current", "net_buoyancy", "cg_offset"])
def test_p_values_are_uniform_when_only_the_stated_uncertainty_is_at_work(under_the_null, name):
    assert kstest(under_the_null[name], "uniform").pvalue > 0.01


def test_a_coefficient_group_within_its_stated_uncertainty_gives_uniform_p_values(under_the_null):
    assert kstest(under_the_null["added_mass"], "uniform").pvalue > 0.01


def test_without_the_stated_uncertainty_the_same_logs_look_as_if_something_were_missing(world):
    """The nuisance must be large enough to matter, or the tests above would prove nothing."""
    assert np.mean(p_values(world, ["ocean_current"], base=[], draws=60) < 0.05) > 0.2
    exact = World(layout(uncertainty={g: 1e-3 for g in GROUPS}), world.jacobian, world.run)
    random = np.random.default_rng(0)
    missed = [
        scored(exact, world.errors(world.drawn(random), random), ["added_mass"])[0].p_value < 0.05
        for _ in range(60)
    ]
    assert np.mean(missed) > 0.5


def test_missing_effects_and_coefficients_beyond_what_was_stated_are_seen(world):
    current = p_values(world, ["ocean_current"], draws=60, ocean_current=0.5 * np.array([0.3, 0.3, 0.1]))
    group = p_values(world, ["added_mass"], draws=60, added_mass=np.array([1, -1, 1, -1, 1, -1]) * 4 * STATED)
    assert np.mean(current < 0.01) > 0.9 and np.mean(group < 0.01) > 0.9


def test_errors_that_are_correlated_in_time_do_not_make_false_alarms():
    """Sensitivities and errors both slow: taken as white, almost every log would seem to lack something."""
    at = layout(["ocean_current", "net_buoyancy"])
    smooth = np.ones(12)
    world = World.random(at, windows=200, samples=24, strength=10.0)
    flat = world.jacobian.reshape(-1, world.jacobian.shape[-1])
    slow = np.stack([np.convolve(c, smooth, "same") for c in flat.T], 1) / np.sqrt(12)
    world = World(at, slow.reshape(world.jacobian.shape), world.run)

    def noise(random, shape):
        return np.convolve(random.normal(size=shape[0] * shape[1]), smooth, "same").reshape(shape) / np.sqrt(
            12
        )

    found = p_values(world, ["ocean_current"], noise=noise, draws=200)
    assert 0.01 < np.mean(found < 0.05) < 0.12
    random = np.random.default_rng(1)
    errors = world.errors(world.drawn(random), random, noise)
    one = scored(world, errors, ["ocean_current"])[0]
    assert 4 < one.inflation < 16
    _, gradient, information = project(world.statistics(errors), world.layout, GROUPS, "ocean_current")
    naive = gradient @ np.linalg.solve(information, gradient)
    assert naive == pytest.approx(one.statistic * one.inflation, rel=1e-6)
    assert naive > 20


def test_the_estimate_is_unbiased_with_the_standard_error_that_it_states(world):
    truth, random = np.array([0.2, -0.1, 0.05]), np.random.default_rng(5)
    z = []
    for _ in range(DRAWS):
        errors = world.errors(world.drawn(random, ocean_current=truth), random)
        found = scored(world, errors, ["ocean_current"])[0]
        z.append((found.estimate - truth) / found.std)
    assert (np.abs(np.mean(z, 0)) < 4 / np.sqrt(DRAWS)).all()
    np.testing.assert_allclose(np.std(z, 0), 1.0, atol=0.15)


def test_it_does_not_matter_at_which_values_of_the_uncertain_coefficients_the_log_was_linearised(world):
    random = np.random.default_rng(6)
    errors = world.errors(world.drawn(random, net_buoyancy=5.0), random)
    here = score(world.statistics(errors), world.layout, GROUPS, "net_buoyancy")
    columns = world.layout.of(GROUPS)
    theta = world.means.copy()
    theta[columns] *= 1 + 0.1 * random.normal(size=len(columns))
    there = score(world.statistics(errors, theta), world.at(theta[columns], GROUPS), GROUPS, "net_buoyancy")
    assert there.statistic * there.inflation == pytest.approx(here.statistic * here.inflation, rel=1e-6)
    np.testing.assert_allclose(there.estimate, here.estimate, rtol=1e-6)


def test_the_gain_is_what_a_dense_fit_gains(world):
    random = np.random.default_rng(7)
    errors = world.errors(world.drawn(random, cg_offset=np.array([0.05, 0.02, -0.04])), random)
    found = score(world.statistics(errors), world.layout, GROUPS, "cg_offset")
    held = priors(world.layout, GROUPS)
    flat, e = world.jacobian.reshape(-1, world.jacobian.shape[-1]), errors.ravel()
    nuisance, effect = (flat[:, world.layout.of(n)] for n in (GROUPS, ["cg_offset"]))
    pull = np.diag(np.sqrt(held.precision))
    tall = np.concatenate([nuisance, pull]), np.concatenate([e, np.zeros(len(pull))])
    without = np.linalg.lstsq(*tall, rcond=None)
    both = np.concatenate([tall[0], np.concatenate([effect, np.zeros((len(pull), 3))])], axis=1)
    with_it = np.linalg.lstsq(both, tall[1], rcond=None)
    assert found.gain == pytest.approx(float((without[1] - with_it[1]).item()), rel=1e-6)
    np.testing.assert_allclose(found.estimate, with_it[0][-3:], rtol=1e-6)
    covariance = np.linalg.inv(both.T @ both)[-3:, -3:]
    np.testing.assert_allclose(found.std, np.sqrt(np.diag(covariance) * found.inflation), rtol=1e-6)


def test_the_evidence_favours_an_effect_when_it_is_there_and_not_when_it_is_not(world):
    random, there, absent = np.random.default_rng(8), [], []
    for _ in range(50):
        for out, change in ((there, 0.6 * np.array([0.3, -0.3, 0.1])), (absent, np.zeros(3))):
            errors = world.errors(world.drawn(random, ocean_current=change), random)
            out.append(scored(world, errors, ["ocean_current"])[0].evidence)
    assert np.mean(np.array(there) > 3) > 0.9 and np.mean(np.array(absent) < 0) > 0.9


def test_an_effect_found_before_is_no_longer_held_by_its_prior(world):
    """A group that was named may be anywhere, so what it does must not be laid at another's door."""
    moved = {"added_mass": np.array([1.0, -0.6, 1.5, -0.5, 1.0, 2.0])}
    random = np.random.default_rng(9)
    held, freed = [], []
    for _ in range(60):
        errors = world.errors(world.drawn(random, **moved), random)
        held.append(scored(world, errors, ["ocean_current"])[0].p_value)
        freed.append(scored(world, errors, ["ocean_current"], free=("added_mass",))[0].p_value)
    assert np.mean(np.array(held) < 0.05) > 0.2
    assert kstest(freed, "uniform").pvalue > 0.01


def test_what_the_log_says_nothing_about_has_no_p_value_below_one_and_no_standard_error(world):
    silent = World(world.layout, world.jacobian.copy(), world.run)
    silent.jacobian[..., world.layout.columns["thruster_lag"]] = 0.0
    silent.jacobian[..., world.layout.columns["ocean_current"][1]] = 0.0
    random = np.random.default_rng(10)
    sums = silent.statistics(silent.errors(silent.drawn(random), random))
    lag = score(sums, silent.layout, GROUPS, "thruster_lag")
    assert (lag.p_value, lag.degrees, lag.gain) == (1.0, 0, 0.0) and np.isnan(lag.std).all()
    np.testing.assert_array_equal(lag.estimate, [0.0])
    current = score(sums, silent.layout, GROUPS, "ocean_current")
    assert current.degrees == 2
    np.testing.assert_array_equal(np.isnan(current.std), [False, True, False])
    assert current.estimate[1] == 0.0


def test_of_two_parameters_of_which_only_the_sum_is_seen_each_is_as_uncertain_as_its_prior_leaves_it():
    at = layout(["cg_offset"], uncertainty=0.0)
    assert at.names == ("cg_offset",)
    world = World.random(at, mixing=0.0, strength=50.0)
    world.jacobian[..., 1] = world.jacobian[..., 0]
    found = score(
        world.statistics(np.random.default_rng(0).normal(size=world.jacobian.shape[:2])), at, [], "cg_offset"
    )
    scale = at.model.effect("cg_offset").parameters_of[0].scale
    assert found.degrees == 2
    # The sum is known, the difference is free by ten plausible sizes each way.
    np.testing.assert_allclose(found.std[:2], 10 * scale / np.sqrt(2), rtol=0.01)
    assert found.std[2] < 0.1 * scale


def whitened(random, information, windows, factor):
    return (
        random.normal(size=(windows, len(information)))
        @ np.linalg.cholesky(information / windows).T
        * np.sqrt(factor)
    )


@pytest.mark.parametrize(
    ("windows", "parameters", "larger"), [(20, 14, 1.0), (20, 8, 3.0), (12, 3, 1.0), (30, 8, 3.0)]
)
def test_chance_is_as_rare_as_stated_with_few_windows(windows, parameters, larger):
    """Scores drawn with a variance that is as told, or larger in all directions alike, most of it in some windows."""
    rng, draws = np.random.default_rng(0), 3000
    root = rng.normal(size=(windows, parameters, 2 * parameters)) * rng.gamma(0.5, 1.0, (windows, 1, 1))
    each, run = root @ root.transpose(0, 2, 1), np.zeros(windows, dtype=int)
    information = each.sum(0)
    inverse = np.linalg.inv(information)
    shares = InformationShares.rows(each, inverse_root(information))
    noise = share_left(ScoreMoments.of(shares, run), parameters)
    below = []
    for _ in range(draws):
        by_window = np.sqrt(larger) * (root @ rng.normal(size=(windows, 2 * parameters, 1)))[..., 0]
        gradient = by_window.sum(0)
        left = by_window - each @ (inverse @ gradient)
        factor = variance_inflation(left, information, run, left=noise)
        statistic = gradient @ inverse @ gradient / factor
        below.append(stats.f.sf(statistic / parameters, parameters, freedom(windows, parameters)))
    for level in (0.05, 0.005):
        assert np.mean(np.array(below) < level) < level + 3 * np.sqrt(level / draws)
    # Nor is it a test that hardly ever rejects.
    assert np.mean(np.array(below) < 0.3) > 0.1


def test_with_many_windows_the_whole_covariance_of_the_scores_is_allowed_for():
    assert freedom(200, 8) == 192 and freedom(20, 14) == 40 and freedom(20, 1) == 19 and freedom(3, 1) == 4


@pytest.mark.parametrize("factor", [1.0, 3.0, 20.0])
def test_inflation_recovers_a_known_overdispersion(factor):
    random = np.random.default_rng(0)
    root = random.normal(size=(3, 3)) * np.array([1.0, 1e3, 1e-3])
    information = root.T @ root
    by_window = whitened(random, information, 2000, factor) + random.normal(size=3) * 1e-3
    assert variance_inflation(by_window, information, np.arange(2000)) == pytest.approx(factor, rel=0.06)


def test_inflation_counts_neighbours_of_a_run_by_half_and_never_falls_below_one():
    random, information = np.random.default_rng(1), np.diag([4.0, 0.01])
    fresh = whitened(random, information, 4001, 1.0)
    linked = fresh[1:] + fresh[:-1]
    information = information * 4000 / 4001
    # Variance two, and one to each neighbour: 2 + 0.5 (1 + 1).
    assert variance_inflation(linked, information, np.zeros(4000)) == pytest.approx(3.0, rel=0.08)
    assert variance_inflation(linked, information, np.arange(4000)) == pytest.approx(2.0, rel=0.08)
    assert variance_inflation(0.1 * fresh, information, np.arange(4001)) == 1.0
    assert variance_inflation(fresh, np.zeros((2, 2)), np.arange(4001)) == 1.0


def test_similarity_is_one_for_the_same_trace_nothing_for_a_right_angle_and_one_sided_for_a_part(world):
    at = layout(["net_buoyancy", "thruster_lag", "ocean_current", "cg_offset"], uncertainty=0.0)
    same = World.random(at, mixing=0.0, strength=200.0)
    j, columns = same.jacobian, at.columns
    size = {n: np.array([p.scale for p in at.model.effect(n).parameters_of]) for n in at.names}
    j[..., columns["thruster_lag"][0]] = (
        -3.0 * j[..., columns["net_buoyancy"][0]] * size["net_buoyancy"][0] / size["thruster_lag"][0]
    )
    # The current's first component is net buoyancy too; the other two are its own.
    j[..., columns["ocean_current"][0]] = (
        j[..., columns["net_buoyancy"][0]] * size["net_buoyancy"][0] / size["ocean_current"][0]
    )
    flat = j.reshape(-1, j.shape[-1])
    others = flat[:, at.of(["net_buoyancy", "thruster_lag", "ocean_current"])]
    cg = columns["cg_offset"]
    flat[:, cg] -= others @ np.linalg.lstsq(others, flat[:, cg], rcond=None)[0]
    names = list(at.names)
    found = similarity(same.statistics(np.zeros(j.shape[:2])), at, [], names)
    by = {(a, b): found[names.index(a), names.index(b)] for a in names for b in names}
    assert by["net_buoyancy", "thruster_lag"] > 0.999 and by["thruster_lag", "net_buoyancy"] > 0.999
    assert by["net_buoyancy", "ocean_current"] > 0.999
    assert by["ocean_current", "net_buoyancy"] == pytest.approx(1 / 3, abs=0.05)
    assert max(by["cg_offset", n] for n in names if n != "cg_offset") < 1e-6
    assert (np.diag(found) == 1).all()


def test_what_is_uncertain_anyway_is_taken_out_before_two_effects_are_compared(world):
    at = layout(["net_buoyancy", "thruster_lag"], uncertainty={"linear_damping": 10.0})
    one = World.random(at, mixing=0.0, strength=200.0)
    j, columns = one.jacobian, at.columns
    shared = j[..., columns["linear_damping"][0]] * 1.0
    for n in ("net_buoyancy", "thruster_lag"):
        scale = at.model.effect(n).parameters_of[0].scale
        j[..., columns[n][0]] = shared / scale + 0.1 * j[..., columns[n][0]]
    names, sums = ["net_buoyancy", "thruster_lag"], one.statistics(np.zeros(j.shape[:2]))
    assert similarity(sums, at, [], names)[0, 1] > 0.9
    assert similarity(sums, at, ["linear_damping"], names)[0, 1] < 0.1
