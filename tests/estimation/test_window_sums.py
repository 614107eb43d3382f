"""Sums over windows against dense projections, and the noise that is read from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.window_normal_equations import LOOSE, normal_equations, residual_std
from auvnn.estimation.window_sums.kept_products import Wanted
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.estimation.bare_statistics import bare_statistics
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def some_windows():
    """Three windows, the last one shorter, of a log that only lends its shape."""
    log = make_log(GreyBox(small_vehicle()), runs=1, duration=2.6, rate=10.0, accelerations=True)
    return cut_windows(log, 1.0, partial=True)


@pytest.fixture(scope="module")
def made_up(some_windows):
    """Windows with random masks, and random answers in two chunks: nothing of them comes from a model."""
    make = torch.Generator().manual_seed(3)

    def draw(*shape):
        return torch.randn(*shape, generator=make, dtype=torch.float64)

    count, length = some_windows.mask.shape[:2]
    mask = some_windows.mask * (torch.rand(count, length, 18, generator=make) < 0.8)
    size = 10.0 ** draw(18)
    whole = Response(
        draw(count, length, 18) * size * mask,
        draw(count, length, 18, 12) * mask[..., None],
        draw(count, length, 18, 4) * size[:, None] * mask[..., None],
    )
    parts = [Response(whole.error[a:b], whole.state[a:b], whole.parameters[a:b]) for a, b in ((0, 2), (2, 3))]
    sigma = size.numpy() * np.linspace(0.5, 2.0, 18)
    sigma[4] = np.inf
    return replace(some_windows, mask=mask), whole, parts, sigma


def test_reduce_equals_a_dense_projection(made_up):
    windows, whole, parts, sigma = made_up
    found, a, slopes = normal_equations(windows, parts, sigma)
    weight = np.where(np.isfinite(sigma), 1 / sigma, 0.0)
    for b in range(len(windows)):
        e = (whole.error[b].numpy() * weight).ravel()
        state = (whole.state[b].numpy() * weight[:, None]).reshape(-1, 12)
        j = (whole.parameters[b].numpy() * weight[:, None]).reshape(-1, 4)
        # The pull of the initial state is twelve more rows.
        tall = np.concatenate([state, np.diag(1 / LOOSE)])

        def out(y, tall=tall):
            y = np.concatenate([y, np.zeros((12, *y.shape[1:]))])
            best = np.linalg.lstsq(tall, y, rcond=None)[0]
            return y - tall @ best, best

        left_e, best_e = out(e)
        left_j, best_j = out(j)
        np.testing.assert_allclose(found.cost[b], left_e @ left_e, rtol=1e-9)
        np.testing.assert_allclose(found.slope[b], left_j.T @ left_e, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(found.hessian[b], left_j.T @ left_j, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(a[b], best_e, rtol=1e-7, atol=1e-10)
        np.testing.assert_allclose(slopes[b], best_j, rtol=1e-7, atol=1e-10)


def test_reduce_counts_errors_samples_and_jumps_by_channel(made_up):
    windows, whole, parts, sigma = made_up
    found, a, _ = normal_equations(windows, parts, sigma)
    for b in range(len(windows)):
        for channel in range(18):
            on = (windows.mask[b, :, channel].numpy() > 0) & np.isfinite(sigma[channel])
            e = whole.error[b, :, channel].numpy() - whole.state[b, :, channel].numpy() @ a[b]
            assert found.count[b, channel] == on.sum()
            assert found.channel[b, channel] == pytest.approx(np.sum(e[on] ** 2), rel=1e-9, abs=1e-12)
            both = on[1:] & on[:-1]
            assert found.pairs[b, channel] == both.sum()
            assert found.rough[b, channel] == pytest.approx(
                np.sum(np.diff(e)[both] ** 2), rel=1e-9, abs=1e-12
            )
    np.testing.assert_array_equal(found.run, windows.run)
    np.testing.assert_array_equal(found.first, windows.first)
    some = found.columns([2, 0])
    np.testing.assert_array_equal(some.hessian[:, 0, 1], found.hessian[:, 2, 0])
    np.testing.assert_array_equal(some.slope[:, 1], found.slope[:, 0])


def test_white_noise_is_told_from_a_slow_error_by_its_jumps():
    random = np.random.default_rng(0)
    slow = np.sin(np.linspace(0, 6, 500))[:, None]
    e = random.normal(size=(40, 500, 18)) * 0.02 + 0.3 * slow
    jumps = np.diff(e, axis=1)
    count = np.full((40, 18), 500.0)
    count[:, 3] = 0.0
    seen = count > 0
    sums = bare_statistics(np.sum(e**2, 1) * seen, count, np.sum(jumps**2, 1) * seen, 499.0 * seen)
    np.testing.assert_allclose(np.delete(sums.noise(), 3), 0.02, rtol=0.03)
    assert np.isnan(sums.noise()[3])
    sigma = residual_std(sums, np.zeros(18), parameters=0)
    assert np.isinf(sigma[3])
    np.testing.assert_allclose(np.delete(sigma, 3), np.sqrt(0.3**2 * np.mean(slow**2) + 0.02**2), rtol=0.05)
    assert residual_std(sums, np.full(18, 7.0), 0)[0] == 7.0


def test_the_spread_allows_for_the_states_and_parameters_that_were_fitted():
    """Eighteen channels of pure noise, from which each window has fitted its twelve initial numbers."""
    random = np.random.default_rng(1)
    windows, length = 200, 12
    e = random.normal(size=(windows, length * 18))
    basis = np.linalg.qr(random.normal(size=(windows, length * 18, 12)))[0]
    left = e - np.einsum("bij,bkj,bk->bi", basis, basis, e)
    sums = bare_statistics(
        np.sum(left.reshape(windows, length, 18) ** 2, 1),
        np.full((windows, 18), float(length)),
        np.zeros((windows, 18)),
        np.ones((windows, 18)),
    )
    assert np.mean(residual_std(sums, np.zeros(18), 0) ** 2) == pytest.approx(1.0, rel=0.02)
    assert np.mean(np.sum(sums.channel, 0) / sums.count.sum(0)) < 0.96


WANTED = (np.array([2, 0]), (np.array([1]), np.array([3])))


@pytest.mark.parametrize("pairs", [False, True])
def test_products_that_are_asked_for_are_those_of_the_whole_matrix(made_up, pairs):
    windows, _, parts, sigma = made_up
    base, blocks = WANTED
    dense, *_ = normal_equations(windows, parts, sigma)
    kept, *_ = normal_equations(windows, parts, sigma, wanted=Wanted(base, blocks, pairs))
    for columns in ([1, 2, 0], [3, 0], [0, 2], [3]):
        np.testing.assert_allclose(kept.block(np.array(columns)), dense.block(np.array(columns)), atol=1e-9)
    np.testing.assert_allclose(kept.slope, dense.slope, atol=1e-9)
    np.testing.assert_allclose(kept.cost, dense.cost, atol=1e-9)
    whole = dense.total.copy()
    if not pairs:
        whole[1, 3] = whole[3, 1] = 0.0
    np.testing.assert_allclose(kept.total, whole, atol=1e-9)
    with pytest.raises(KeyError, match="not kept"):
        kept.block(np.array([1, 3]))


def test_what_has_no_finite_sums_says_nothing_in_kept_products_either(made_up):
    windows, _, parts, sigma = made_up
    parts = [replace(part, parameters=part.parameters.clone()) for part in parts]
    for part in parts:
        part.parameters[..., 3] *= np.inf
    base, blocks = WANTED
    kept, *_ = normal_equations(windows, parts, sigma, wanted=Wanted(base, blocks))
    finite = kept.finite()
    assert np.isfinite(finite.total).all() and np.isfinite(finite.block(np.array([3, 0, 2]))).all()
    assert not finite.total[3].any() and not finite.block(np.array([3, 0]))[:, 0].any()
    np.testing.assert_allclose(finite.block(np.array([1, 2])), kept.block(np.array([1, 2])))


def test_a_short_step_is_worth_what_the_equations_say(made_up):
    """Errors that are linear in the parameters: the sums after a step are those of the errors after it."""
    windows, whole, _, sigma = made_up
    step = np.array([0.3, -0.2, 0.1, 0.4])
    before, *_ = normal_equations(windows, [whole], sigma)
    moved = replace(whole, error=whole.error - (whole.parameters @ torch.as_tensor(step)))
    after, *_ = normal_equations(windows, [moved], sigma)
    told = before.after(step)
    np.testing.assert_allclose(told.slope, after.slope, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(told.cost, after.cost, rtol=1e-9)
    gain = NormalEquations(before.total, before.slope.sum(0)).gain(step)
    assert before.cost.sum() - after.cost.sum() == pytest.approx(gain)
