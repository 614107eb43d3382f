"""Commands between samples: a log that was thinned out is told from one whose commands were held."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.answer import _held
from auvnn.diagnosis.noise_law.command_holding import (
    Holding,
    between,
    cubic_weights,
    holding,
    uncertain_wrench,
)
from auvnn.logs import Log
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

STEP = 5


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def thinned(log: Log, step: int) -> Log:
    """Return every so many-th sample of a log."""
    runs = []
    for run in log.runs:
        arrays = {n: getattr(run, n) for n in ("t", "quaternion", "nu", "position", "thrusters")}
        runs.append(replace(run, **{n: x[::step].copy() for n, x in arrays.items()}))
    return Log.from_runs(runs, name=log.name)


def asked(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    return holding(first, windows)


def test_commands_that_change_every_tick_are_not_held(model):
    """Five ticks of a fast controller a sample: the mean command of an interval is two fifths on the way to the next."""
    log = thinned(make_log(model, duration=20.0, rate=25.0, noise=0.3, max_step=0.04), STEP)
    found = asked(model, log)
    assert found.name in ("ahead", "linear", "smooth") and found.share == pytest.approx(0.4, abs=0.11)
    assert found.odds > np.log(100.0) and found.to_dict()["between_samples"] == found.name


def test_commands_that_were_held_are_held(model):
    found = asked(model, make_log(model, duration=20.0, rate=5.0, noise=0.3))
    assert found.name == "held" and found.share == 0.0


def test_a_share_mixes_each_sample_with_the_next(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    mixed, plain = between(windows, 0.25).inputs.command, windows.inputs.command
    assert torch.allclose(mixed[:, :-1], 0.75 * plain[:, :-1] + 0.25 * plain[:, 1:])
    assert torch.equal(mixed[:, -1], plain[:, -1]) and between(windows, 0.0) is windows


def test_the_cubic_through_four_samples_has_the_mean_of_any_cubic():
    """By the closed form of the integral of a power; over the interval itself -1, 13, 13, -1 over 24."""
    assert np.allclose(cubic_weights(0.5), np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0)
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    for share in (0.0, 0.3, 0.41, 1.0):
        for power in range(4):
            low, high = share - 0.5, share + 0.5
            mean = (high ** (power + 1) - low ** (power + 1)) / (power + 1)
            assert np.dot(cubic_weights(share), at**power) == pytest.approx(mean, abs=1e-12)


def test_a_smooth_command_is_the_mean_of_its_cubic(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    mixed, plain = between(windows, 0.5, smooth=True).inputs.command, windows.inputs.command
    own = (-plain[:, :-3] + 13.0 * plain[:, 1:-2] + 13.0 * plain[:, 2:-1] - plain[:, 3:]) / 24.0
    assert torch.allclose(mixed[:, 1:-2], own)


def test_a_fit_that_grows_without_bound_is_passed_over(model):
    """Its squared error may have been the smallest while it was fitted: the next best says how commands go."""
    log = make_log(model, duration=12.0, rate=5.0, noise=0.3)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=2)
    none = replace(first.fitted.statistics, channel=0.0 * first.fitted.statistics.channel)
    wild = replace(first, fitted=replace(first.fitted, initial=1e160 * first.fitted.initial, statistics=none))
    with pytest.raises(np.linalg.LinAlgError, match="without bound"):
        holding(wild, windows)

    def found(first, *tried):
        state: Any = SimpleNamespace(
            first=first, tried=list(tried), current=wild, refuted=None, windows=windows
        )
        return _held(state)

    assert found(first, wild) == (first, holding(first, windows))
    assert found(wild)[1].name == "held"


def commanded(values, curve=lambda u: u):
    """Return a model whose six commands are its wrench by a curve, and windows of one command in surge."""
    command = torch.zeros(1, len(values), 6, dtype=torch.float64)
    command[0, :, 0] = torch.as_tensor(values)
    actuators = SimpleNamespace(static=curve, allocation=torch.eye(6, dtype=torch.float64))
    windows: Any = Shape(Given(command), length=np.array([len(values) - 2]))
    return SimpleNamespace(actuators=actuators), windows


@dataclass(frozen=True)
class Given:
    """What is given to a vehicle."""

    command: torch.Tensor
    fins: None = None


@dataclass(frozen=True)
class Shape:
    """As much of windows as is looked at."""

    inputs: Given
    length: np.ndarray
    warmup: int = 2


def test_a_parabola_of_commands_leaves_the_sixth_of_its_bend_uncertain():
    """The mean of b t^2 over an interval is b (k^2 + k + 1/3), that of its chord b (k^2 + k + 1/2)."""
    k = np.arange(30.0)
    model, windows = commanded(0.02 * k**2)
    found = uncertain_wrench(model, windows, Holding("linear", 0.5, 9.0, 9.0))
    assert found[0] == pytest.approx(0.02 / 6.0, rel=1e-9) and not found[1:].any()


def test_a_curve_of_the_thrust_adds_what_the_mean_command_does_not_give():
    """A straight line of commands with T = c^2: the mean of the square less the square of the mean is step^2 / 12."""
    model, windows = commanded(0.1 * np.arange(20.0), lambda u: u**2)
    found = uncertain_wrench(model, windows, Holding("smooth", 0.5, 9.0, 9.0))
    assert found[0] == pytest.approx(0.1**2 / 12.0, rel=1e-9)


def test_commands_that_change_within_intervals_leave_half_their_step_and_held_ones_nothing():
    model, windows = commanded(0.3 * np.arange(20.0))
    assert uncertain_wrench(model, windows, Holding("ahead", 0.3, 9.0, 9.0))[0] == pytest.approx(0.15)
    assert not uncertain_wrench(model, windows, Holding("held", 0.0, 0.0, 0.0)).any()
