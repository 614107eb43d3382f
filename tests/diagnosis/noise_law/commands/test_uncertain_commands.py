"""What commands between samples leave uncertain, against closed forms and a controller made by hand."""

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
from auvnn.diagnosis.noise_law.commands import uncertain
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.uncertain import (
    UncertainWrench,
    in_closed_loop,
    law_differences,
    noise_answered,
    uncertain_wrench,
)
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.models import GreyBox, load
from tests.small_logs import make_log, sines, small_vehicle


def fitted(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    return fit_hypothesis(layout, windows, list(layout.names), (), iterations=4), windows


def commanded(values, curve=lambda u: u):
    """Return a model whose six commands are its wrench by a curve, and windows of one command in surge."""
    command = torch.zeros(1, len(values), 6, dtype=torch.float64)
    command[0, :, 0] = torch.as_tensor(values)
    actuators = SimpleNamespace(static=curve, allocation=torch.eye(6, dtype=torch.float64))
    times = 0.05 * torch.arange(len(values), dtype=torch.float64).unsqueeze(0)
    windows: Any = Shape(Given(command), np.array([len(values) - 2]), times)
    return SimpleNamespace(actuators=actuators), windows


@dataclass(frozen=True)
class Given:
    """What is given to a vehicle."""

    command: torch.Tensor
    fins: torch.Tensor | None = None
    within: torch.Tensor | None = None
    fins_within: torch.Tensor | None = None


@dataclass(frozen=True)
class Shape:
    """As much of windows as is looked at."""

    inputs: Given
    length: np.ndarray
    times: torch.Tensor
    max_step: float = 0.05
    nu: torch.Tensor | None = None
    warmup: int = 2


def test_a_parabola_of_commands_leaves_the_sixth_of_its_bend_uncertain():
    """The mean of b t^2 over an interval is b (k^2 + k + 1/3), that of its chord b (k^2 + k + 1/2)."""
    k = np.arange(30.0)
    model, windows = commanded(0.02 * k**2)
    found = law_differences(model, windows, Holding("linear", 0.5, 9.0, 9.0))
    assert found[0] == pytest.approx(0.02 / 6.0, rel=1e-9) and not found[1:].any()


def test_a_curve_of_the_thrust_adds_what_the_mean_command_does_not_give():
    """A straight line of commands with T = c^2: the mean of the square less the square of the mean is step^2 / 12."""
    model, windows = commanded(0.1 * np.arange(20.0), lambda u: u**2)
    found = law_differences(model, windows, Holding("smooth", 0.5, 9.0, 9.0))
    assert found[0] == pytest.approx(0.1**2 / 12.0, rel=1e-9)


def test_where_the_mean_thrust_is_taken_a_curve_adds_nothing():
    """The same line, with the commands whose square is the mean of the squares."""
    model, windows = commanded(0.04 * np.arange(20.0), lambda u: u**2)
    grid = np.linspace(0.0, 1.0, 100001)
    curves = MeanThrust(grid, np.repeat((grid**2)[:, None], 6, axis=1))
    plain = law_differences(model, windows, Holding("linear", 0.5, 9.0, 9.0))
    found = law_differences(model, windows, Holding("linear", 0.5, 9.0, 9.0, curves=curves))
    assert plain[0] == pytest.approx(0.04**2 / 12.0, rel=1e-9) and found[0] < 1e-4 * plain[0]


def test_commands_that_change_within_intervals_leave_half_their_step():
    model, windows = commanded(0.3 * np.arange(20.0))
    assert law_differences(model, windows, Holding("ahead", 0.3, 9.0, 9.0))[0] == pytest.approx(0.15)


def test_noisy_commands_leave_the_difference_of_line_and_average():
    """Of white noise with variance 1: (1, 3, 3, 1) / 8 less (0, 4, 4, 0) / 8 has the variance 4 / 64."""
    model, windows = commanded(np.random.default_rng(1).normal(size=20000))
    found = law_differences(model, windows, Holding("averaged", 0.5, 9.0, 9.0, 4))
    assert found[0] == pytest.approx(0.25, rel=0.02)


def test_the_power_at_low_frequencies_is_compared():
    """White over 0.05 s with rms 2: an Ornstein-Uhlenbeck force of 0.4 s has as much at 2 sqrt(0.05 / 0.8) = 0.5."""
    white = UncertainWrench(np.zeros(6), np.full(6, 2.0), 0.05)
    assert white.over(np.full(6, 0.4)) == pytest.approx(np.full(6, 0.5))
    assert white.over(np.full(6, 0.01)) == pytest.approx(np.full(6, 2.0))
    smooth = UncertainWrench(np.full(6, 3.0), np.full(6, 4.0), 0.05)
    assert smooth.over(np.full(6, 1e9)) == pytest.approx(np.full(6, 3.0), abs=1e-3)
    assert smooth.to_dict() == pytest.approx(dict.fromkeys("XYZKMN", 5.0))


def test_commands_that_answer_the_noise_leave_its_share_uncertain():
    """Heave's command is -30 N s/m of the measured velocity: of its noise of 0.004 m/s that is 0.12 N."""
    model = GreyBox(small_vehicle(), actuation="wrench")
    log = make_log(model, duration=40.0, rate=10.0, noise=1.0)
    first, windows = fitted(model, log)
    assert (noise_answered(first, windows) < 0.25 * 0.12).all()
    noise = torch.as_tensor(np.random.default_rng(3).normal(size=windows.nu.shape[:2])) * 0.004
    nu, command = windows.nu.clone(), windows.inputs.command.clone()
    nu[..., 2] += noise
    command[:, windows.warmup :, 2] -= 30.0 * noise
    answering = replace(windows, nu=nu, inputs=replace(windows.inputs, command=command))
    found = noise_answered(first, answering)
    held = Holding("held", 0.0, 0.0, 0.0)
    assert uncertain_wrench(first, answering, held).closed_loop
    assert not uncertain_wrench(first, windows, held).closed_loop
    # Half of the noise is the log's own, which nothing answers: what is regressed on is noisy itself.
    assert not in_closed_loop(first, windows) and in_closed_loop(first, answering)
    # About filtered trajectories their errors count, and no run of the model, which may not stay finite.
    diverging = replace(first, fitted=replace(first.fitted, initial=first.fitted.initial * np.inf))
    with pytest.raises(np.linalg.LinAlgError):
        in_closed_loop(diverging, answering)
    around = torch.cat([windows.eta, windows.nu], dim=-1)
    assert in_closed_loop(replace(diverging, around=around), answering)
    other = torch.as_tensor(np.random.default_rng(4).normal(size=windows.nu.shape)) * 0.004
    assert not in_closed_loop(replace(diverging, around=around), replace(windows, nu=windows.nu + other))
    assert 0.5 * 0.12 < found[2] < 1.1 * 0.12 and (np.delete(found, 2)[:2] < 0.4 * found[2]).all()


def test_what_is_held_is_uncertain_only_as_far_as_it_answers_noise():
    model = GreyBox(small_vehicle())
    first, windows = fitted(model, make_log(model, duration=20.0, rate=5.0, noise=0.3))
    held = uncertain_wrench(first, windows, Holding("held", 0.0, 0.0, 0.0))
    assert not held.smooth.any() and held.step == pytest.approx(0.2)
    straight = uncertain_wrench(first, windows, Holding("linear", 0.5, 9.0, 9.0))
    assert straight.smooth.any() and straight.white == pytest.approx(held.white)


@pytest.mark.parametrize(
    ("answers", "dwell", "counts"),
    [
        # A controller faster than the log: noise of its own between samples, as large as that of the samples.
        (True, 1, True),
        # A command that is white, of itself: nothing answers.
        (False, 1, False),
        # Steps that are held for some samples, with a share that answers: only the share counts.
        (True, 8, False),
    ],
)
def test_all_of_a_noisy_command_counts_where_it_answers_noise_and_is_white(answers, dwell, counts):
    """Heave's command has -30 N s/m of the velocity's noise, 0.12 N, and as much again of noise between the samples."""
    model, random = GreyBox(small_vehicle(), actuation="wrench"), np.random.default_rng(5)
    command = 8.0 * sines(np.arange(401) / 10.0, 6, 2, high=0.08)
    if not counts:
        command[:, 2] += random.normal(size=401)[np.arange(401) // dwell * dwell]
    first, windows = fitted(model, make_log(model, duration=40.0, rate=10.0, noise=0.3, command=command))
    noise, between = torch.as_tensor(random.normal(size=(2, *windows.nu.shape[:2])))
    nu, given = windows.nu.clone(), windows.inputs.command.clone()
    nu[..., 2] += 0.004 * noise
    if answers:
        given[:, windows.warmup :, 2] -= 0.12 * (noise + between if counts else noise)
    found = noise_answered(first, replace(windows, nu=nu, inputs=replace(windows.inputs, command=given)))
    if counts:
        assert found[2] == pytest.approx(np.hypot(0.12, 0.12), rel=0.1)
    else:
        assert found[2] < 0.14


@pytest.mark.parametrize("name", ["held", "linear", "averaged"])
def test_what_answers_noise_counts_by_every_law_of_the_commands(monkeypatch, name):
    model = GreyBox(small_vehicle())
    first, windows = fitted(model, make_log(model, duration=20.0, rate=5.0, noise=0.3))
    answered = np.array([1e6, 0.0, 0.0, 0.0, 0.0, 0.0])
    monkeypatch.setattr(uncertain, "noise_answered", lambda *_: answered)
    held = Holding(name, 0.5, 0.0 if name == "held" else 9.0, 9.0, 4)
    found = uncertain_wrench(first, windows, held)
    assert found.white[0] == 1e6
    # Averages leave white uncertainty of their own, in the other degrees of freedom too; lines a smooth one.
    assert (found.white[1:] > 0.0).any() == (name == "averaged")
    assert found.smooth.any() == (name == "linear")


def test_fins_in_the_flow_count_too():
    """A stern plane that swings by one degree from sample to sample: by the lift of a flat fin, all but the noise."""
    model = load("remus100")
    fins = np.zeros((40, 4))
    fins[::2, 2:], fins[1::2, 2:] = 0.01, -0.01
    nu = torch.zeros(1, 38, 6, dtype=torch.float64)
    nu[..., 0] = 1.5
    given = Given(torch.zeros(1, 40, 1, dtype=torch.float64), torch.as_tensor(fins)[None])
    times = 0.05 * torch.arange(40, dtype=torch.float64).unsqueeze(0)
    windows: Any = Shape(given, np.array([38]), times, nu=nu)
    found = law_differences(model, windows, Holding("ahead", 0.3, 9.0, 9.0))
    fin = model.vehicle.fins[2]
    lift = 0.5 * model.vehicle.water_density * fin.area * fin.lift_slope * 1.5**2 * 0.01
    assert np.hypot(found[1], found[2]) == pytest.approx(2.0 * lift, rel=0.02)


@pytest.mark.parametrize(("gain", "closed"), [(0.15, True), (0.0, False)])
def test_a_small_answer_to_the_noise_is_a_controllers(gain, closed):
    """Of a command's changes, 1 in the mean, a controller that answers noise of 1 by 0.15 makes 2 %."""
    model = GreyBox(small_vehicle(), actuation="wrench")
    first, windows = fitted(model, make_log(model, duration=60.0, rate=20.0, noise=0.0))
    random = np.random.default_rng(5)
    noise = torch.as_tensor(0.004 * random.normal(size=windows.nu.shape))
    command = windows.inputs.command.clone()
    begin, count = windows.warmup, windows.nu.shape[1]
    own = torch.as_tensor(0.004 * random.normal(size=(len(noise), count)))
    command[:, begin:, 2] = own + gain * noise[..., 2]
    seen = replace(first, around=torch.cat([windows.eta, windows.nu], dim=-1))
    answering = replace(windows, nu=windows.nu + noise, inputs=replace(windows.inputs, command=command))
    assert in_closed_loop(seen, answering) is closed


def test_a_held_velocity_and_a_smooth_command_are_no_closed_loop():
    """A velocity that is late by a hold of four samples has the bends of the command that drives it."""
    model = GreyBox(small_vehicle(), actuation="wrench")
    first, windows = fitted(model, make_log(model, duration=60.0, rate=20.0, noise=0.0))
    rows = windows.inputs.command.shape[1] - windows.warmup
    times = torch.arange(rows, dtype=torch.float64) * 0.05
    command = windows.inputs.command.clone()
    command[:, windows.warmup :, 2] = torch.sin(10.5 * times)
    nu, held = windows.nu.clone(), torch.arange(nu_length := windows.nu.shape[1]) // 4 * 4
    late = -torch.cos(10.5 * times[:nu_length])
    nu[..., 2] += late[held] - late
    nu += 1e-4 * torch.as_tensor(np.random.default_rng(6).normal(size=nu.shape))
    seen = replace(first, around=torch.cat([windows.eta, windows.nu], dim=-1))
    asked = replace(windows, nu=nu, inputs=replace(windows.inputs, command=command))
    told = uncertain._fast_errors(seen, asked)
    assert told is not None
    usable, regressors = told
    share, _ = uncertain._predicted(
        uncertain._fast(command[:, windows.warmup :])[usable].numpy()[:, 2:3], regressors
    )
    assert share[0] > 0.01 and not in_closed_loop(seen, asked)
