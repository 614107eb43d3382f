"""The filter through windows against the joint Gaussian of all their forces and states, and bounds of the parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from auvnn.diagnosis.noise_law.likelihood.law_likelihood import FIRST_TIME, VAGUE, Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums, States
from auvnn.diagnosis.noise_law.likelihood.window_filter import LEAST
from auvnn.estimation.force_marginalisation.sums import LOOSE
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw, correlation

WINDOWS, CELLS, KNOWN, ROWS, CELL = 3, 3, 2, 40, 0.5


class Linear:
    """Three windows of one run, whose errors are linear in parameters, initial states and a force in cells."""

    def __init__(self, follows, seed=0, gap=(0.0, 0.0)):
        rng = np.random.default_rng(seed)
        self.state = rng.normal(size=(WINDOWS, ROWS, 12))
        self.force = rng.normal(size=(WINDOWS, ROWS, 6 * CELLS))
        self.known = rng.normal(size=(WINDOWS, ROWS, KNOWN))
        self.error = rng.normal(size=(WINDOWS, ROWS))
        size = np.array([0.5] * 12 + [0.3] * (KNOWN + 6 * CELLS) + [1.0])
        self.ends = size * rng.normal(size=(WINDOWS, 12, 12 + KNOWN + 6 * CELLS + 1))
        self.offset, self.follows = rng.normal(size=(WINDOWS, 12)), np.array([False, *follows])
        self.before, self.gap = np.array([-1, 0, 1]), np.array([0.0, *gap])

    def sums(self):
        """Return them as the diagnosis has them: the best initial states taken out, and what they were beside."""
        square = np.einsum("bri,brj->bij", self.state, self.state)
        columns = np.concatenate([self.error[..., None], self.known, self.force], axis=-1)
        across = np.einsum("bri,brj->bij", self.state, columns)
        whole = np.einsum("bri,brj->bij", columns, columns)
        whole -= across.transpose(0, 2, 1) @ np.linalg.solve(square + np.diag(LOOSE**-2.0), across)
        none, run = np.zeros((WINDOWS, 18)), np.ones(WINDOWS, dtype=int)
        statistics = Statistics(
            whole[:, 1:, 1:], whole[:, 0, 1:], whole[:, 0, 0], none, none, none, none, run, 10 * np.arange(WINDOWS)
        )  # fmt: skip
        states = States(square, across, self.ends, self.offset, self.follows)
        reach = np.array([[-np.inf], [np.inf]]) * np.ones(KNOWN)
        return ForceSums(
            statistics, KNOWN, CELLS, np.zeros(KNOWN), np.zeros(KNOWN), np.full(KNOWN, 1e-9), reach, np.ones(6),
            (0.1, 10.0), CELLS * CELL, CELL, None, self.before, self.gap, states,
        )  # fmt: skip

    def correlation(self, time):
        """Return the covariance of the process's means over all cells, those of different windows apart by the gaps."""
        own = correlation(WINDOWS * CELLS, CELL, time)
        begins = CELL * np.arange(WINDOWS * CELLS) + np.repeat(np.cumsum(self.gap), CELLS)
        between = np.abs(begins[:, None] - begins) - CELL
        # The integral of exp(-|t - s| / time) over two cells that do not overlap, by both lengths.
        apart = np.exp(-between / time) * (1.0 - np.exp(-CELL / time)) ** 2 * (time / CELL) ** 2
        return np.where(between > -0.5 * CELL, apart, own)

    def joint(self, law, theta):
        """Return minus twice the log likelihood by one large Gaussian: all cells of the chain, all initial states."""
        cells = WINDOWS * CELLS
        size = 12 + 6 * cells + 12 * (WINDOWS - 1)
        covariance = np.zeros((size, size))
        covariance[:12, :12] = np.diag(LOOSE**2)
        for i in law.axes:
            own = slice(12 + i * cells, 12 + (i + 1) * cells)
            covariance[own, own] = law.rms[i] ** 2 * self.correlation(law.time[i])
        state, mean, rows, means = np.eye(12, size), np.zeros(12), [], []
        for b in range(WINDOWS):
            force = np.zeros((6 * CELLS, size))
            for i in range(6):
                force[i * CELLS : (i + 1) * CELLS, 12 + i * cells + b * CELLS :][:, :CELLS] = np.eye(CELLS)
            rows.append(self.state[b] @ state + self.force[b] @ force)
            means.append(self.error[b] - self.known[b] @ theta - self.state[b] @ mean)
            if b == WINDOWS - 1:
                break
            own = slice(12 + 6 * cells + 12 * b, 12 + 6 * cells + 12 * (b + 1))
            if self.follows[b + 1]:
                covariance[own, own] = np.diag((LOOSE * LEAST) ** 2)
                on, by, through, away = np.split(
                    self.ends[b], [12, 12 + KNOWN, 12 + KNOWN + 6 * CELLS], axis=1
                )
                mean = on @ mean + by @ theta + away[:, 0] + self.offset[b + 1]
                state = on @ state + through @ force
            else:
                covariance[own, own] = np.diag(LOOSE**2)
                mean, state = np.zeros(12), np.zeros((12, size))
            state[:, own] += np.eye(12)
        seen, left = np.concatenate(rows), np.concatenate(means)
        whole = seen @ covariance @ seen.T + np.eye(len(left))
        return float(left @ np.linalg.solve(whole, left) + np.linalg.slogdet(whole)[1])


def law_of(time):
    return ForceLaw(np.array([1.0, 0, 0.5, 0, 0, 2.0]), np.full(6, time), CELL, CELLS * CELL)


@pytest.mark.parametrize("follows", [(True, True), (True, False), (False, False)])
@pytest.mark.parametrize("time", [0.02, 0.7, 50.0])
def test_windows_one_after_the_other_are_as_likely_as_all_together(follows, time):
    linear, theta, law = Linear(follows), np.array([0.3, -0.2]), law_of(time)
    sums = Likelihood(linear.sums()).by_window(law)
    value = float((sums.cost - 2 * sums.slope @ theta + ((sums.hessian @ theta) @ theta)).sum())
    assert value == pytest.approx(linear.joint(law, theta), abs=1e-3)


@pytest.mark.parametrize("time", [0.3, 2.0])
def test_a_force_is_known_the_less_the_longer_ago_the_window_before_ended(time):
    linear, theta, law = Linear((False, False), gap=(0.4, 1.1)), np.array([0.3, -0.2]), law_of(time)
    sums = Likelihood(linear.sums()).by_window(law)
    value = float((sums.cost - 2 * sums.slope @ theta + ((sums.hessian @ theta) @ theta)).sum())
    assert value == pytest.approx(linear.joint(law, theta), abs=1e-3)


def test_without_a_force_states_still_go_from_window_to_window():
    linear, theta = Linear((True, True)), np.array([0.3, -0.2])
    nothing = ForceLaw(np.zeros(6), np.ones(6), CELL, CELLS * CELL)
    sums = Likelihood(linear.sums()).by_window(None)
    value = float((sums.cost - 2 * sums.slope @ theta + ((sums.hessian @ theta) @ theta)).sum())
    assert value == pytest.approx(linear.joint(nothing, theta), abs=1e-4)


@pytest.mark.parametrize("before", [(-1, 0, 1), (-1, 0, -1), (-1, -1, -1)])
@pytest.mark.parametrize("gap", [(0.0, 0.0), (0.4, 1.1)])
@pytest.mark.parametrize("follows", [(True, True), (False, True)])
def test_the_slope_in_the_law_is_that_of_its_likelihood(follows, gap, before):
    sums = replace(Linear(follows, gap=gap).sums(), before=np.array(before))
    likelihood, axes = Likelihood(sums), [0, 2, 5]
    x = np.log([1.0, 0.5, 2.0, 0.7, 0.2, 3.0])
    _, slope = likelihood.sloped(axes, x)
    for k, unit in enumerate(1e-5 * np.eye(6)):
        ends = [likelihood.sloped(axes, x + way * unit)[0] for way in (1.0, -1.0)]
        assert slope[k] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("size", [1e-4, 1e2])
@pytest.mark.parametrize("time", [0.1, 10.0])
def test_so_it_is_at_the_ends_of_what_a_law_may_be(size, time):
    """Against the filter, differentiated by reverse mode."""
    likelihood, axes = Likelihood(Linear((True, False), gap=(0.0, 0.3)).sums()), [0, 2, 5]
    x = np.log(np.array([size] * 3 + [time] * 3))
    value, slope = likelihood.sloped(axes, x)
    step = likelihood.of(likelihood.law(axes, np.full(3, size), np.full(3, time)))[1]
    free = torch.tensor(x, requires_grad=True)
    follow, total = torch.as_tensor(np.concatenate([[1.0], -step])), torch.zeros(())
    for _, square, volume in likelihood.filter.windows(axes, free[:3].exp(), free[3:].exp()):
        total = total + follow @ square.sum(0) @ follow + volume.sum()
    (expected,) = torch.autograd.grad(total, free)
    prior = 2.0 * (x - np.concatenate([np.zeros(3), np.full(3, np.log(FIRST_TIME))])) / VAGUE**2
    assert slope == pytest.approx(expected.numpy() + prior, rel=1e-6, abs=1e-6)
    assert np.isfinite(value)


def test_a_parameter_that_would_pass_a_bound_ends_there_and_the_others_follow():
    linear, law = Linear((True, True), seed=4), law_of(0.7)
    free = Likelihood(linear.sums()).of(law)[1]
    reach = np.array([[-10.0, -10.0], [10.0, 10.0]])
    reach[int(free[0] > 0), 0] = 0.4 * free[0]
    value, step, _, gain = Likelihood(replace(linear.sums(), reach=reach)).of(law)
    assert step[0] == pytest.approx(0.4 * free[0]) and abs(step[1] - free[1]) > 1e-6
    found = minimize(lambda x: linear.joint(law, x), np.zeros(2), bounds=reach.T, tol=1e-12)
    assert step == pytest.approx(found.x, abs=1e-4) and value == pytest.approx(found.fun, abs=1e-3)
    assert gain == pytest.approx(linear.joint(law, np.zeros(2)) - found.fun, abs=1e-3)


def test_sums_that_say_less_than_nothing_of_a_parameter_leave_it_where_it_is(recwarn):
    """A window of enormous errors rounds away what the others say of it; the others follow as if it were held."""
    found = Likelihood(Linear([True, True]).sums())
    whole = np.eye(KNOWN + 1)
    whole[0, 1:] = whole[1:, 0] = 2.0
    whole[1, 1] = -3.0
    whole[1, 2] = whole[2, 1] = 1e4
    step, _, _ = found._followed(whole)
    np.testing.assert_allclose(step, [0.0, *[2.0] * (KNOWN - 1)], rtol=1e-6)
    assert not recwarn.list
