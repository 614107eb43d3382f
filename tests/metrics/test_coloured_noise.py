"""Innovations of coloured noise against the covariance matrix of all measurements."""

from __future__ import annotations

import numpy as np
import torch

from auvnn.metrics.coloured_noise import NoiseColour, previous


def test_innovations_weigh_as_the_whole_covariance_does():
    """Sum of squares and determinant, with rows that are missing and steps that vary; channels that are white stay so."""
    random = np.random.default_rng(0)
    times = np.cumsum(random.uniform(0.02, 0.2, size=40))
    mask = np.ones((1, 40, 18))
    mask[0, random.permutation(40)[:12], :] = 0.0
    time = np.where(np.arange(18) % 2, 0.7, 0.0)
    errors = random.normal(size=(1, 40, 18)) * mask
    colour = NoiseColour(time)
    tensors = torch.as_tensor(mask), torch.as_tensor(times)[None]
    found = colour.whitened(torch.as_tensor(errors), *tensors)[0].numpy() * mask[0]
    kept = mask[0, :, 0] > 0
    covariance = np.exp(-np.abs(times[kept][:, None] - times[kept]) / 0.7)
    for k in range(18):
        own = covariance if time[k] else np.eye(kept.sum())
        e = errors[0, kept, k]
        np.testing.assert_allclose((found[:, k] ** 2).sum(), e @ np.linalg.solve(own, e), rtol=1e-9)
    expected = 9 * np.linalg.slogdet(covariance)[1]
    np.testing.assert_allclose(colour.log_determinant(*tensors), expected, rtol=1e-9)


def test_derivatives_are_treated_alike():
    random = np.random.default_rng(1)
    mask, times = torch.ones(2, 30, 18), torch.arange(30.0)[None].repeat(2, 1) * 0.1
    colour = NoiseColour(np.full(18, 0.5))
    slopes = torch.as_tensor(random.normal(size=(2, 30, 12, 5)))
    together = colour.whitened(slopes, mask, times)
    for k in range(5):
        alone = colour.whitened(slopes[..., k], mask, times)
        assert torch.equal(together[..., k], alone)


def test_the_measurement_before_is_found_across_gaps():
    mask = torch.tensor([1.0, 0.0, 0.0, 1.0, 1.0])[None, :, None]
    assert previous(mask)[0, :, 0].tolist() == [-1, 0, 0, 0, 3]


def test_two_measurements_of_one_moment_are_as_good_as_one():
    """They say the same of a process: their difference is rounding, and must not count as infinitely unlikely."""
    mask, times = torch.ones(1, 3, 18), torch.tensor([[0.0, 1.0, 1.0]], dtype=torch.float64)
    colour = NoiseColour(np.full(18, 0.5))
    errors = torch.tensor([1.0, 2.0, 2.0], dtype=torch.float64)[None, :, None].expand(1, 3, 18).contiguous()
    found = colour.whitened(errors, mask, times)
    assert torch.isfinite(found).all() and (found[:, 2].abs() < 0.1).all()
    assert torch.isfinite(torch.as_tensor(colour.log_determinant(mask, times)))
