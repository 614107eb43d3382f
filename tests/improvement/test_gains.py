"""What add() rests on: gains with their uncertainty, the noise floor, and coefficients put into the vehicle's numbers."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.put_into_model import with_body
from auvnn.improvement.gains import paired_gain
from auvnn.logs import Log, Run
from auvnn.metrics.noise_floor import noise_floor
from auvnn.metrics.rollouts import Rolled, Scale, roll, scale_of
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene
from tests.diagnosis.linear_world import layout
from tests.small_logs import make_log, small_vehicle

GROUPS = ("added_mass", "linear_damping", "quadratic_damping", "inertia")


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def made_up(squared, held, count):
    windows = len(squared)
    cut = cut_windows(still(0.1 * windows + 1.0), 1.0, 0.1)
    assert len(cut) >= windows
    return Rolled(
        cut.pick(slice(0, windows)),
        np.zeros((windows, 11, 6)),
        squared,
        held,
        count,
        np.zeros(windows, dtype=bool),
    )


def still(duration):
    t = np.arange(0, duration + 0.05, 0.1)
    return Log.from_runs(
        [Run(0, t, np.tile([1.0, 0, 0, 0], (len(t), 1)), np.zeros((len(t), 6)), wrench=np.zeros((len(t), 6)))]
    )


def test_the_gain_and_its_uncertainty_are_those_of_leaving_blocks_out():
    random = np.random.default_rng(0)
    before, after = random.chisquare(5, (60, 6)) * 2.0, random.chisquare(5, (60, 6))
    count = np.full((60, 6), 10.0)
    scale = Scale(np.array([1.0, 2, 1, 1, 1, 1]), np.array([True, True, False, True, True, True]))
    value, std = paired_gain(made_up(before, before, count), made_up(after, before, count), scale)

    def error(squared, keep):
        each = np.sqrt(squared[keep].sum(0) / count[keep].sum(0)) / scale.std
        return np.mean(each[scale.excited])

    every = np.ones(60, dtype=bool)
    assert value == pytest.approx(error(before, every) - error(after, every))
    without = []
    for block in range(20):
        keep = np.arange(60) // 3 != block
        without.append(error(before, keep) - error(after, keep))
    assert std == pytest.approx(np.sqrt(19 / 20 * np.sum((np.array(without) - np.mean(without)) ** 2)))
    # About what the windows' own scatter says about a mean of sixty.
    assert 0.05 < std / value < 0.3


def test_one_window_says_nothing_about_its_own_uncertainty():
    one = np.ones((1, 6))
    scale = Scale(np.ones(6), np.ones(6, dtype=bool))
    assert paired_gain(made_up(2 * one, one, one), made_up(one, one, one), scale)[1] == np.inf


def test_the_noise_floor_is_what_the_true_model_shows_on_noisy_data(model):
    log = make_log(model, runs=3, duration=15.0, noise=2.0)
    scale = scale_of(log)
    rolled = roll(model, log, "2", scale)
    assert noise_floor(model, rolled, log, scale) == pytest.approx(rolled.total(scale), rel=0.12)
    silent = make_log(model, runs=1, duration=8.0)
    rolled = roll(model, silent, "2", scale_of(silent))
    assert noise_floor(model, rolled, silent, scale_of(silent)) < 0.002


def test_baking_moves_factors_into_matrices_elements_and_inertia():
    """A vehicle with full matrices and displaced elements: the same accelerations with and without the effects."""
    vehicle = example_vehicle()
    factors = {
        "added_mass": {"X": 1.2, "M": 0.8},
        "linear_damping": {"Y": 1.3, "N": 0.7},
        "quadratic_damping": {"Z": 0.6, "K": 1.5},
        "inertia": {"K": 1.1, "N": 0.9},
    }
    factored = GreyBox(vehicle).with_effects(factors)
    baked = GreyBox(with_body(vehicle, factored.prepare().body))
    scene = make_scene(vehicle, "thrusters", runs=20)
    row = scene.inputs.each()[0]
    rates = [m(scene.eta, scene.nu, row.command, fins=row.fins) for m in (factored, baked, GreyBox(vehicle))]
    torch.testing.assert_close(rates[0], rates[1], rtol=1e-10, atol=1e-10)
    assert float((rates[0] - rates[2]).detach().abs().max()) > 0.01
    for changed, old in zip(baked.vehicle.damping_elements, vehicle.damping_elements, strict=True):
        np.testing.assert_allclose(changed.linear / old.linear, [1, 1.3, 1, 1, 1, 0.7])
    assert layout().nuisance == GROUPS
