"""The height above the bottom without the altimeter's noise: against the height that a vehicle truly has."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.logs import Log, Run
from auvnn.logs.altitude import altitude_at_samples, altitude_over_intervals
from auvnn.metrics.one_step.replay import OneStepReplay
from auvnn.metrics.windows import cut_windows
from auvnn.models import load

NOISE = 0.02


def heaving(
    noise: float = NOISE, rate: float = 20.0, slope: float = 0.0, seed: int = 5, **other
) -> tuple[Run, object]:
    """Return a run of a vehicle that pitches and heaves above a bottom, and its true height as a function of time."""
    t = np.arange(0.0, 60.0, 1.0 / rate)

    def height(at):
        return 1.0 + 0.5 * np.cos(0.7 * at) + slope * at

    pitch = 0.3
    # Down in NED; at this pitch the rate of descent is shared by surge and heave.
    sinking = 0.35 * np.sin(0.7 * t)
    nu = np.zeros((len(t), 6))
    nu[:, 0], nu[:, 2] = -np.sin(pitch) * sinking, np.cos(pitch) * sinking
    attitude = np.tile([np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0], (len(t), 1))
    draw = np.random.default_rng(seed)
    measured = height(t) + noise * draw.standard_normal(len(t))
    nu[:, :3] += 0.005 * draw.standard_normal((len(t), 3))
    given = {"altitude": measured, **{k: v(measured) for k, v in other.items()}}
    return Run(0, t, attitude, nu, thrusters=np.zeros((len(t), 2)), **given), height


@pytest.mark.parametrize("slope", [0.0, 0.01])
def test_most_of_the_noise_is_gone_and_nothing_of_the_motion(slope):
    run, height = heaving(slope=slope)
    left = altitude_at_samples(run) - height(run.t)
    assert left.std() < 0.25 * NOISE
    assert np.abs(left).max() < 1.2 * NOISE
    # The part of the motion that is missing, by regression.
    assert abs(np.polyfit(height(run.t), left, 1)[0]) < 0.01


def test_over_an_interval_it_is_the_height_about_its_middle():
    run, height = heaving(rate=5.0)
    middle = altitude_over_intervals(run)
    assert np.std(middle[:-1] - height(run.t[:-1] + 0.1)) < 0.4 * NOISE
    # A tenth of a second of the motion, which the height at the sample lacks.
    assert np.std(middle[:-1] - height(run.t[:-1])) > 0.02


def test_without_noise_it_stays_as_it_was():
    run, height = heaving(noise=0.0)
    assert np.abs(altitude_at_samples(run) - height(run.t)).max() < 0.005


def test_gaps_outliers_and_values_that_stand_are_bridged_by_the_motion():
    def gap(x):
        x = x.copy()
        x[300:400] = np.nan
        x[700] += 3.0
        return x

    def held(x):
        return x[np.arange(len(x)) // 4 * 4]

    for change in (gap, held):
        run, height = heaving(altitude=change)
        left = altitude_at_samples(run) - height(run.t)
        assert np.abs(left).max() < 1.5 * NOISE
    # By itself the gap of five seconds, most of a period, would be a straight line.
    run, height = heaving(altitude=gap)
    assert np.abs(run.filled("altitude") - height(run.t)).max() > 0.3


def test_a_step_of_the_bottom_is_no_noise():
    run, height = heaving(altitude=lambda x: x - 0.5 * (np.arange(len(x)) >= 600))
    left = altitude_at_samples(run) - height(run.t) + 0.5 * (np.arange(run.samples) >= 600)
    away = np.abs(np.arange(run.samples) - 600) > 130
    assert left[away].std() < 0.3 * NOISE


def test_none_and_nothing_measured():
    run, _ = heaving()
    bare = Run(0, run.t, run.quaternion, run.nu, thrusters=run.thrusters)
    assert altitude_at_samples(bare) is None and altitude_over_intervals(bare) is None
    blind, _ = heaving(altitude=lambda x: np.full_like(x, np.nan))
    assert altitude_at_samples(blind) is None
    still, height = heaving(altitude=lambda x: x)
    lost = Run(
        0, still.t, still.quaternion * np.nan, still.nu, thrusters=still.thrusters, altitude=still.altitude
    )
    # Without an attitude nothing says how the vehicle moves: what is measured stands, less noise.
    assert np.isfinite(altitude_at_samples(lost)).all()
    assert np.std(altitude_at_samples(lost) - height(still.t)) < NOISE


def test_windows_are_driven_by_it():
    run, height = heaving()
    cut = cut_windows(Log.from_runs([run], name="heaving"), 2.0)
    given = cut.inputs.altitude
    assert given is not None
    left = given.numpy() - height(cut.times.numpy() + 0.5 * run.dt)
    assert float(left[:, :-1].std()) < 0.35 * NOISE


def test_predictions_one_step_ahead_are_driven_by_it_at_their_samples():
    run, height = heaving(rate=5.0)
    many = Run(0, run.t, run.quaternion, run.nu, thrusters=np.zeros((run.samples, 8)), altitude=run.altitude)
    given = OneStepReplay(load("bluerov2_heavy"), many).inputs.altitude
    assert given is not None
    assert np.std(given.numpy() - height(run.t)) < 0.4 * NOISE


def test_before_a_break_of_the_recording_it_is_the_height_at_the_sample():
    run, _ = heaving()
    kept = np.r_[0:400, 700:1200]
    there = {"thrusters": run.thrusters[kept], "altitude": run.altitude[kept]}
    broken = Run(0, run.t[kept], run.quaternion[kept], run.nu[kept], **there)
    at, over = altitude_at_samples(broken), altitude_over_intervals(broken)
    assert over[399] == at[399] and over[-1] == at[-1]
    assert over[398] == pytest.approx(0.5 * (at[398] + at[399]), abs=1e-12)
    # The height after the break is another one: half of it would be far off.
    assert abs(at[400] - at[399]) > 0.1
