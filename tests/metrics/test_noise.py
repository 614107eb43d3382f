"""Noise of a run: told at any heading, and added once more."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.logs import Run
from auvnn.logs.signals.noise import noise_std
from auvnn.logs.signals.rotation import conjugate, from_euler, multiply
from auvnn.metrics.noise import attitude_noise, with_more_noise

T = np.arange(0, 100, 0.05)
STD = np.array([0.002, 0.004, 0.008])


def run_at(heading: float, std=STD, seed=0) -> Run:
    random = np.random.default_rng(seed)
    truth = from_euler(np.stack([0.3 * np.sin(T), 0.2 * np.cos(0.7 * T), heading + 0.3 * np.sin(0.2 * T)], 1))
    turn = std / 2 * random.normal(size=(len(T), 3))
    small = np.concatenate([np.sqrt(1 - (turn**2).sum(1, keepdims=True)), turn], 1)
    quaternion = multiply(truth, small) * random.choice([-1.0, 1.0], (len(T), 1))
    nu = 0.2 * np.sin(np.outer(T, np.arange(1, 7) / 5)) + 0.01 * random.normal(size=(len(T), 6))
    return Run(0, T, quaternion, nu)


@pytest.mark.parametrize("heading", [0.0, 1.6, 3.1, -2.0])
def test_attitude_noise_is_the_same_at_any_heading_and_sign(heading):
    np.testing.assert_allclose(attitude_noise(run_at(heading)), STD, rtol=0.1)


def test_attitude_without_noise_has_none_and_a_missing_sample_does_not_matter():
    assert attitude_noise(run_at(2.0, std=0 * STD)).max() < 2e-6
    run = run_at(1.0)
    quaternion = run.quaternion.copy()
    quaternion[500:503] = np.nan
    np.testing.assert_allclose(attitude_noise(Run(0, T, quaternion, run.nu)), STD, rtol=0.1)


def test_noisier_adds_as_much_noise_as_there_is():
    run = run_at(2.5)
    more = with_more_noise(run)
    np.testing.assert_allclose(np.std(more.nu - run.nu, axis=0), 0.01, rtol=0.15)
    turn = 2 * multiply(conjugate(run.quaternion), more.quaternion)[:, 1:]
    np.testing.assert_allclose(turn.std(0), STD, rtol=0.15)
    np.testing.assert_allclose(np.asarray(noise_std(T, more.nu)), 0.01 * np.sqrt(2), rtol=0.15)
    assert more.nu_dot is None
    np.testing.assert_array_equal(with_more_noise(run).nu, more.nu)
