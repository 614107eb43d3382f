"""Commands that change between the log's samples: made signals, our own manoeuvres, and a controller that is faster."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.logs import Log
from auvnn.logs.quality.command_rate import CLEAR, between_samples, unpredicted
from auvnn.models import load
from auvnn.simulation import simulate
from auvnn.simulation.excitations import EXCITATIONS
from auvnn.simulation.excitations.base import make_excitation
from tests.log_samples import make_log, make_run


def of_commands(y, dt=0.05):
    return Log.from_runs([make_run(n=len(y), dt=dt, thrusters=np.asarray(y)[:, None])])


def band_limited(t, highest, rng, count=40):
    """Sines below a frequency, Hz, each with a separate phase."""
    f, phase = rng.uniform(0.0, highest, count), rng.uniform(0.0, 2 * np.pi, count)
    return np.sin(2 * np.pi * np.outer(t, f) + phase).sum(1) / np.sqrt(count) * 0.3


def test_white_noise_is_wholly_unpredicted_and_a_slow_sine_wholly_predicted():
    rng = np.random.default_rng(1)
    white, t = rng.normal(size=20000), 0.05 * np.arange(20000)
    run = make_run(n=20000)
    share, changing = unpredicted(run, white)
    assert share == pytest.approx(1.0, abs=0.03) and changing == 1.0
    assert unpredicted(run, np.sin(0.4 * t))[0] < 1e-4
    # A sine of w rad per sample leaves 1 - (4 cos w - cos 2w)/3 of itself, whose median is half a right angle's.
    w = 1.0
    left = 1.0 - (4.0 * np.cos(w) - np.cos(2.0 * w)) / 3.0
    wanted = left * np.sqrt(2.0) * np.sin(np.pi / 4) / (np.sqrt(1 + 34 / 36) * 0.6745)
    assert unpredicted(run, np.sin(w * np.arange(20000)))[0] == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("rate", [20.0, 5.0])
def test_a_command_far_below_half_the_sampling_rate_is_no_finding(rate):
    t = np.arange(600) / rate
    y = band_limited(t, rate / 10.0, np.random.default_rng(2))
    assert between_samples(of_commands(y, 1.0 / rate)) == []
    assert between_samples(make_log(2, noise=0.02)) == []


@pytest.mark.parametrize("rate", [20.0, 5.0])
def test_a_command_with_more_than_that_is_noted_once_with_rate_and_cure(rate):
    t = np.arange(600) / rate
    y = band_limited(t, 3.0 * rate, np.random.default_rng(3))
    [found] = between_samples(of_commands(y, 1.0 / rate))
    assert found.level == "info" and found.where == "commands"
    assert f"{rate:g} Hz" in found.what and "thruster_1" in found.what and "controller" in found.cure
    assert found.to_dict() in of_commands(y, 1.0 / rate).quality().to_dict()["findings"]


@pytest.mark.parametrize("held", [2, 5, 40])
def test_steps_at_samples_that_last_are_no_finding(held):
    rng = np.random.default_rng(4)
    y = np.repeat(rng.uniform(-0.8, 0.8, 600 // held), held)
    assert between_samples(of_commands(y)) == []
    # And steps on top of a slow signal.
    slow = 0.3 * np.sin(0.02 * np.arange(len(y)))
    assert between_samples(of_commands(np.repeat(rng.uniform(-0.8, 0.8, 15), 40) + slow[:600])) == []


def test_gaps_rest_and_short_runs_say_nothing():
    rng = np.random.default_rng(5)
    y = rng.normal(size=600)
    run = make_run(n=600)
    assert unpredicted(run, np.full(600, 0.3)) == (0.0, 0.0)
    assert unpredicted(make_run(n=30), y[:30]) == (0.0, 0.0)
    y[::5] = np.nan
    assert unpredicted(run, y) == (0.0, 0.0)


@pytest.mark.parametrize("excitation", ["multisine", "chirp", "pulses"])
@pytest.mark.parametrize("rate", [20.0, 5.0])
def test_the_packages_own_manoeuvres_are_no_finding(excitation, rate):
    t = np.arange(round(40.0 * rate) + 1) / rate
    plan = make_excitation(excitation, EXCITATIONS).plan(load("rov95"), t, [np.random.default_rng(1)])
    run = make_run(n=len(t), dt=1.0 / rate, thrusters=plan.command[0])
    assert between_samples(Log.from_runs([run])) == []
    assert max(unpredicted(run, y)[0] for y in run.thrusters.T) < CLEAR


@pytest.mark.long
@pytest.mark.parametrize("rate", [20.0, 5.0])
def test_a_controller_of_100_hz_is_noted_in_logs_of_less(rate):
    log = simulate(
        "rov95",
        "survey",
        "realistic",
        runs=1,
        duration=25.0,
        rate=rate,
        seed=1,
        plant="numpy",
        world="between",
    ).log
    [found] = between_samples(log)
    assert "thruster_" in found.what and f"{rate:g} Hz or faster" in found.what
