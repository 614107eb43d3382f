"""The law of a stochastic force: found again from linear windows, and not where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from auvnn.diagnosis.noise_law.likelihood.estimate_law import boundary_p_value, estimate
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import ROUGHLY, Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import correlation

CELL = 0.5


def linear_windows(rms, time, *, windows=80, cells=10, known=2, seed=0, strength=3.0) -> ForceSums:
    """Sums of windows of unit noise whose errors are linear in a force in cells and in some parameters."""
    rng = np.random.default_rng(seed)
    samples, size = 8 * cells, 6 * cells
    hessian, slope, cost = [], [], []
    theta = rng.normal(size=known)
    roots = [r * np.linalg.cholesky(correlation(cells, CELL, t)) for r, t in zip(rms, time, strict=True)]
    for _ in range(windows):
        # What a force has done stays for a while: sums over the cells before.
        reach = np.tril(np.exp(-0.3 * np.subtract.outer(np.arange(cells), np.arange(cells))))
        force = np.zeros((samples, size))
        for i in range(6):
            force[:, i * cells : (i + 1) * cells] = rng.normal(size=(samples, cells)) @ reach
        force *= strength / np.sqrt(samples)
        jacobian = np.concatenate([rng.normal(size=(samples, known)), force], axis=1)
        drawn = np.concatenate([root @ rng.normal(size=cells) for root in roots])
        error = jacobian @ np.concatenate([theta, drawn]) + rng.normal(size=samples)
        hessian.append(jacobian.T @ jacobian)
        slope.append(jacobian.T @ error)
        cost.append(error @ error)
    none, run = np.zeros((windows, 18)), np.arange(windows) // 20
    statistics = Statistics(
        np.array(hessian), np.array(slope), np.array(cost), none, none, none, none, run, run
    )
    return ForceSums(
        statistics, known, cells, np.zeros(known), np.zeros(known), np.full(known, 1e-4),
        np.array([[-np.inf], [np.inf]]) * np.ones(known),
        np.ones(6), (0.1, 6.0), cells * CELL, CELL,
    )  # fmt: skip


def test_variances_and_correlation_times_come_back():
    rms, time = np.array([2.0, 1.0, 0.0, 3.0, 0.0, 1.5]), np.array([0.7, 4.0, 1.0, 2.0, 1.0, 1.2])
    found = estimate(Likelihood(linear_windows(rms, time)))
    assert found.law is not None and found.law.axes == [0, 1, 3, 5]
    assert found.law.rms == pytest.approx(rms, rel=0.2)
    ratio = found.law.time[found.law.axes] / time[found.law.axes]
    assert (ratio > 0.5).all() and (ratio < 2.0).all()
    assert (found.p_values[[0, 1, 3, 5]] < 0.01).all() and (found.p_values[[2, 4]] >= 0.01).all()


def test_without_a_force_the_variance_is_zero():
    """Six tests at a level of one in a hundred: among 40 logs some three at most, were the test exact."""
    found = [
        estimate(Likelihood(linear_windows(np.zeros(6), np.ones(6), windows=30, cells=4, seed=s)))
        for s in range(40)
    ]
    assert sum(f.law is not None for f in found) <= 6


def test_the_gradient_is_that_of_the_value():
    likelihood = Likelihood(linear_windows(np.full(6, 1.0), np.full(6, 1.0), windows=10, cells=5))
    x = np.log(np.array([0.8, 1.5, 0.6, 2.0]))
    _, slope = likelihood.sloped([1, 4], x)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-4
        numeric = (likelihood.sloped([1, 4], x + step)[0] - likelihood.sloped([1, 4], x - step)[0]) / 2e-4
        assert slope[k] == pytest.approx(numeric, rel=1e-3, abs=1e-4)


def test_the_likeliest_law_is_where_another_search_ends_too():
    rms, time = np.array([2.0, 0.1, 1.0, 3.0, 1.0, 1.5]), np.array([0.2, 5.0, 1.0, 2.0, 1.0, 1.2])
    likelihood = Likelihood(linear_windows(rms, time, windows=30, cells=4))
    axes, asked, sloped = [0, 3], [], likelihood.sloped
    likelihood.sloped = lambda *given: asked.append(1) or sloped(*given)  # type: ignore[method-assign]
    start = np.zeros(4)
    value, x = likelihood.best(axes, start)
    steps = len(asked)
    # In plain logarithms by a simplex within the same bounds: neither units nor slopes.
    low = np.log([*1e-4 * likelihood.sums.sizes[axes], *[likelihood.sums.times[0]] * 2])
    high = np.log([*1e2 * likelihood.sums.sizes[axes], *[likelihood.sums.times[1]] * 2])
    other = minimize(
        lambda z: sloped(axes, z)[0], start, method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": 2000, "maxfev": 2000, "xatol": 1e-4, "fatol": 1e-4, "adaptive": True},
    )  # fmt: skip
    assert value == pytest.approx(other.fun, abs=0.02)
    assert value == pytest.approx(sloped(axes, x)[0], abs=1e-9)
    assert steps < 40


def test_a_law_that_is_found_roughly_is_short_by_less_than_a_step_must_promise():
    rms, time = np.array([2.0, 0.1, 1.0, 3.0, 1.0, 1.5]), np.array([0.2, 5.0, 1.0, 2.0, 1.0, 1.2])
    likelihood = Likelihood(linear_windows(rms, time, windows=30, cells=4))
    asked, sloped = [], likelihood.sloped
    likelihood.sloped = lambda *given: asked.append(1) or sloped(*given)  # type: ignore[method-assign]
    value = likelihood.best([0, 3], np.zeros(4))[0]
    many = len(asked)
    rough = likelihood.best([0, 3], np.zeros(4), enough=ROUGHLY)[0]
    assert value < rough < value + ROUGHLY and len(asked) - many < many


def test_the_likelihood_is_that_of_the_full_covariance():
    sums = linear_windows(np.full(6, 1.0), np.ones(6), windows=3, cells=3, known=1)
    likelihood = Likelihood(sums)
    law = likelihood.law([0, 3], np.array([1.2, 0.5]), np.array([0.8, 2.0]))
    value, step, information, gain = likelihood.of(law)
    # A vector with J^T e and J^T J as the window's has the same likelihood, up to what no law changes.
    expected, prior = 0.0, sums.precision[0]
    square, pull, own = prior, 0.0, [1, 2, 3, 10, 11, 12]
    inner = np.zeros((6, 6))
    for k in range(2):
        inner[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = law.factors[k] @ law.factors[k].T
    for w in range(3):
        hessian, slope = sums.statistics.hessian[w], sums.statistics.slope[w]
        kernel = np.linalg.inv(np.linalg.inv(inner) + hessian[np.ix_(own, own)])
        expected += sums.statistics.cost[w] - slope[own] @ kernel @ slope[own]
        expected += np.linalg.slogdet(np.eye(6) + inner @ hessian[np.ix_(own, own)])[1]
        square += hessian[0, 0] - hessian[0, own] @ kernel @ hessian[own, 0]
        pull += slope[0] - hessian[0, own] @ kernel @ slope[own]
    assert value == pytest.approx(expected - pull**2 / square) and gain == pytest.approx(pull**2 / square)
    assert step[0] == pytest.approx(pull / square) and information[0, 0] == pytest.approx(square - prior)


def test_at_the_boundary_half_of_the_chances_are_none():
    assert boundary_p_value(-1.0) == 1.0 and boundary_p_value(0.0) == 1.0
    assert boundary_p_value(9.21) == pytest.approx(0.005, rel=0.01)


def test_windows_one_by_one_add_up_to_the_likelihood():
    """Against the covariance of each window's errors, worked out whole."""
    sums = linear_windows(np.full(6, 1.0), np.ones(6), windows=4, cells=3, known=2)
    likelihood = Likelihood(sums)
    law = likelihood.law([1, 4], np.array([0.7, 1.1]), np.array([0.9, 2.0]))
    found, (value, step, information, _) = likelihood.by_window(law), likelihood.of(law)
    assert found.hessian.sum(0) == pytest.approx(information, rel=1e-9)
    pull = found.slope.sum(0) - sums.precision * (sums.theta - sums.mean)
    assert found.cost.sum() - pull @ step == pytest.approx(value, rel=1e-9)
    # Of one window: forces integrated out of minus twice the log density, by the inverse of the force's own precision.
    own = np.concatenate([np.arange(3) + 3 * i for i in (1, 4)]) + 2
    h, g = sums.statistics.hessian[0], sums.statistics.slope[0]
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = 0.7**2 * correlation(3, CELL, 0.9)
    covariance[3:, 3:] = 1.1**2 * correlation(3, CELL, 2.0)
    inner = np.linalg.inv(np.linalg.inv(covariance) + h[np.ix_(own, own)])
    cost = sums.statistics.cost[0] - g[own] @ inner @ g[own] - np.linalg.slogdet(inner)[1]
    assert found.cost[0] == pytest.approx(cost + np.linalg.slogdet(covariance)[1], rel=1e-6)
    assert found.slope[0] == pytest.approx(g[:2] - h[:2, own] @ inner @ g[own], rel=1e-6)


def test_a_degree_of_freedom_that_moves_nothing_measured_is_not_asked():
    """Its likelihood ratio is one whatever the law: the answer is that of asking the others alone."""
    sums = linear_windows(np.array([2.0, 0.0, 0.0, 3.0, 0.0, 0.0]), np.ones(6), windows=30, cells=4)
    given = sums.statistics
    hessian, slope = given.hessian.copy(), given.slope.copy()
    for i in (1, 2, 4, 5):
        own = slice(2 + 4 * i, 2 + 4 * (i + 1))
        hessian[:, own], hessian[:, :, own], slope[:, own] = 0.0, 0.0, 0.0
    blind = replace(sums, statistics=replace(given, hessian=hessian, slope=slope))
    assert Likelihood(blind).shown() == [0, 3] and Likelihood(sums).shown() == list(range(6))
    found, among = estimate(Likelihood(blind)), estimate(Likelihood(blind), only=[0, 3])
    assert found.law is not None and among.law is not None and found.law.axes == [0, 3]
    assert (found.p_values[[1, 2, 4, 5]] == 1.0).all() and (found.p_values[[0, 3]] < 0.01).all()
    assert found.value == pytest.approx(among.value, abs=1e-9)
    # A force there would change nothing.
    likelihood = Likelihood(blind)
    more = likelihood.law([0, 1, 3], np.array([2.0, 5.0, 3.0]), np.ones(3))
    same = likelihood.law([0, 3], np.array([2.0, 3.0]), np.ones(2))
    assert likelihood.of(more)[0] == pytest.approx(likelihood.of(same)[0], rel=1e-12)


def chained(sums: ForceSums, length: int) -> ForceSums:
    """Return the sums with windows in chains, one directly after the other."""
    order = np.arange(len(sums.statistics.cost))
    return replace(sums, before=np.where(order % length == 0, -1, order - 1), gap=np.zeros(len(order)))


def test_windows_that_follow_one_another_have_the_likelihood_of_one_long_window():
    """Two windows of one cell each are as likely together as their joint covariance says."""
    sums = chained(linear_windows(np.full(6, 1.0), np.ones(6), windows=2, cells=1, known=1), 2)
    likelihood = Likelihood(sums)
    law = likelihood.law([0, 3], np.array([1.2, 0.5]), np.array([0.8, 2.0]))
    value, step, information, _ = likelihood.of(law)
    hessian, slope = sums.statistics.hessian, sums.statistics.slope
    covariance = np.kron(np.diag([1.0, 0.0]), np.eye(2))
    covariance[:2, :2] = 1.2**2 * correlation(2, CELL, 0.8)
    covariance[2:, 2:] = 0.5**2 * correlation(2, CELL, 2.0)
    # Variables: X in both windows, then K in both; what the windows say of them is apart.
    h, g, across = np.zeros((4, 4)), np.zeros(4), np.zeros(4)
    for w in range(2):
        own = np.ix_([w, 2 + w], [w, 2 + w])
        h[own] = hessian[w][np.ix_([1, 4], [1, 4])]
        g[[w, 2 + w]], across[[w, 2 + w]] = slope[w][[1, 4]], hessian[w][[1, 4], 0]
    kernel = np.linalg.inv(np.linalg.inv(covariance) + h)
    square = hessian[:, 0, 0].sum() - across @ kernel @ across
    pull = slope[:, 0].sum() - across @ kernel @ g
    expected = sums.statistics.cost.sum() - g @ kernel @ g + np.linalg.slogdet(np.eye(4) + covariance @ h)[1]
    assert information[0, 0] == pytest.approx(square)
    assert step[0] == pytest.approx(pull / (square + sums.precision[0]))
    assert value == pytest.approx(expected - pull**2 / (square + sums.precision[0]))
    found = likelihood.by_window(law)
    assert found.hessian.sum() == pytest.approx(square) and found.slope.sum() == pytest.approx(pull)
    # The first window does not know of the second one.
    alone = Likelihood(replace(sums, before=None)).by_window(law)
    assert found.cost[0] == pytest.approx(alone.cost[0]) and found.cost[1] != pytest.approx(
        alone.cost[1], rel=1e-3
    )


def test_the_gradient_is_that_of_the_value_in_chains_too():
    sums = chained(linear_windows(np.full(6, 1.0), np.full(6, 3.0), windows=12, cells=3), 5)
    likelihood = Likelihood(replace(sums, gap=np.where(np.arange(12) == 7, 0.8, 0.0)))
    x = np.log(np.array([0.8, 1.5, 0.6, 2.0]))
    _, slope = likelihood.sloped([1, 4], x)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-4
        numeric = (likelihood.sloped([1, 4], x + step)[0] - likelihood.sloped([1, 4], x - step)[0]) / 2e-4
        assert slope[k] == pytest.approx(numeric, rel=1e-3, abs=1e-4)


def test_a_gap_in_which_the_force_is_forgotten_is_a_new_beginning():
    sums = chained(linear_windows(np.full(6, 1.0), np.full(6, 1.0), windows=6, cells=3), 6)
    law = Likelihood(sums).law([1, 4], np.array([0.7, 1.1]), np.array([0.9, 2.0]))
    far = Likelihood(replace(sums, gap=np.full(6, 100.0))).of(law)[0]
    assert far == pytest.approx(Likelihood(replace(sums, before=None)).of(law)[0], rel=1e-9)
    assert Likelihood(sums).of(law)[0] != pytest.approx(far, rel=1e-6)
