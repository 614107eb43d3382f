"""One-step residuals: the same filter on both sides, held commands, noise floors, refusals."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import freqz, savgol_coeffs, savgol_filter

import tests.metrics.surge_and_roll as simple
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.metrics.derivative import choose_derivative, integrated
from auvnn.metrics.one_step import LogComparison, OneStepReplay, RunComparison, one_step, replay, scores
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

T = np.arange(0, 20.0, 0.05)


@pytest.fixture(scope="module")
def stepped():
    """A perfect, noise-free log whose command jumps every two seconds."""
    return simple.log(T, simple.steps(T))


@pytest.fixture(scope="module")
def moving():
    """A vehicle that moves in all degrees of freedom, its log without noise, and with accelerations."""
    model = GreyBox(small_vehicle())
    return model, make_log(model, runs=2, duration=12.0, rate=20.0, accelerations=True)


def without_accelerations(log: Log) -> Log:
    return Log.from_runs(
        [Run(r.number, r.t, r.quaternion, r.nu, position=r.position, thrusters=r.thrusters) for r in log.runs]
    )


def test_on_even_time_both_sides_pass_scipys_filter(stepped):
    how = choose_derivative(stepped)
    part = one_step(simple.model(linear=(20.0, 3.0)), stepped, how)[0]
    run = stepped.runs[0]
    for j, column in enumerate((simple.SURGE, simple.ROLL)):
        slope = savgol_filter(run.nu[:, column], 9, 2, deriv=1, delta=0.05)
        np.testing.assert_allclose(part.measured[:, column], slope, rtol=0, atol=1e-10)
        force = run.wrench[:-1, column]
        begin, end = (
            simple.rate(j, run.nu[a, column], force, linear=(20.0, 3.0))
            for a in (slice(None, -1), slice(1, None))
        )
        total = np.concatenate([[0], np.cumsum(0.025 * (begin + end))])
        slope = savgol_filter(total, 9, 2, deriv=1, delta=0.05)
        np.testing.assert_allclose(part.model[:, column], slope, rtol=0, atol=1e-10)
        mass = (simple.MASS, simple.ROLL_INERTIA)[j]
        np.testing.assert_allclose(
            part.wrench[:, column], mass * (part.measured - part.model)[:, column], atol=1e-9
        )


def test_a_perfect_model_leaves_nothing_where_the_filter_changes_both_alike(moving):
    model, log = moving
    log = without_accelerations(log)
    how = choose_derivative(log)
    part = one_step(model, log, how)[0]
    size = part.measured.std(0)
    left = np.sqrt(np.mean((part.measured - part.model) ** 2, 0)) / size
    assert (left < 0.004).all()
    # The smoothed value of the acceleration is another filter than the slope of the velocity.
    other = savgol_filter(OneStepReplay(model, log.runs[0]).acceleration(), 9, 2, axis=0)
    assert (np.sqrt(np.mean((part.measured - other) ** 2, 0)) / size > 5 * left).all()


def test_held_commands_do_not_pass_for_half_a_sample_of_lag(stepped):
    model = simple.model()
    how = choose_derivative(stepped)
    run, part = stepped.runs[0], one_step(model, stepped, how)[0]
    held = np.sqrt(np.mean((part.measured - part.model)[:, 0] ** 2))
    # As if the command moved in a straight line from row to row: half a sample early at every jump.
    ramp = savgol_filter(
        integrated(run.t, OneStepReplay(model, run).acceleration()), 9, 2, deriv=1, delta=0.05, axis=0
    )
    ramped = np.sqrt(np.mean((part.measured - ramp)[:, 0] ** 2))
    assert held < 1e-3 * part.measured[:, 0].std()
    assert ramped > 20 * held


def test_the_velocity_that_the_model_adds_up_to_equals_the_measured_one(stepped):
    run = stepped.runs[0]
    total = OneStepReplay(simple.model(), run).velocity()
    gained = run.nu - run.nu[0]
    assert np.abs(total - gained).max() < 2e-3 * np.abs(gained).max()


def test_integrated_is_the_trapezoid_and_stops_at_missing_samples():
    y = np.stack([np.sin(T), T**2], axis=1)
    np.testing.assert_allclose(integrated(T, y), cumulative_trapezoid(y, T, axis=0, initial=0), atol=1e-12)
    y[7, 0] = np.nan
    total = integrated(T, y)
    assert (
        np.isnan(total[7, 0])
        and np.isfinite(np.delete(total[:, 0], 7)).all()
        and np.isfinite(total[:, 1]).all()
    )


def test_a_missing_sample_hides_only_what_its_filter_reaches(stepped):
    run = stepped.runs[0]
    nu = run.nu.copy()
    nu[100, 2] = np.nan
    torn = Log.from_runs([Run(0, run.t, run.quaternion, nu, wrench=run.wrench)])
    model, how = simple.model(linear=(20.0, 3.0)), choose_derivative(stepped)
    whole, part = one_step(model, stepped, how)[0], one_step(model, torn, how)[0]
    lost = np.isnan(part.wrench).all(1)
    assert set(np.flatnonzero(lost)) == set(range(96, 105))
    np.testing.assert_allclose(part.wrench[~lost], whole.wrench[~lost], atol=1e-9)


def test_measured_accelerations_are_taken_as_they_are(moving):
    model, log = moving
    how = choose_derivative(log)
    assert how.method == "measured"
    for part, run in zip(one_step(model, log, how), log.runs, strict=True):
        np.testing.assert_array_equal(part.measured, run.nu_dot)
        np.testing.assert_allclose(part.model, run.nu_dot, atol=1e-9)
    assert how.describe(0.05) == {"method": "measured", "bandwidth_hz": 10.0}


@pytest.mark.parametrize("accelerations", [True, False])
def test_a_model_with_a_lever_arm_and_a_lag_explains_its_own_log(accelerations):
    model = GreyBox(small_vehicle()).with_effects(
        {"velocity_lever_arm": {"x": 0.15, "z": -0.1}, "thruster_lag": {"time_constant": 0.2}}
    )
    log = make_log(model, runs=1, duration=10.0, rate=20.0, accelerations=accelerations)
    how = choose_derivative(log)
    bare = GreyBox(small_vehicle())
    for name, with_it in scores(one_step(model, log, how)).items():
        assert with_it["r2"] > 0.9999, name
    assert min(v["r2"] for v in scores(one_step(bare, log, how)).values()) < 0.99


@pytest.mark.parametrize(("name", "values"), [
    ("actuation_delay", {"delay": 0.03}), ("thruster_lag", {"time_constant": 0.3}),
    ("thruster_gain", {"thruster_1": 0.7}), ("velocity_lever_arm", {"x": 0.2}),
])  # fmt: skip
def test_a_parameter_that_changes_later_counts(name, values):
    """Told which hooks the effect has, a replay says what a new one would."""
    model = GreyBox(small_vehicle()).with_effects({name: values})
    run = make_log(model, runs=1, duration=3.0, rate=20.0).runs[0]
    before = GreyBox(small_vehicle()).with_effects({name: None})
    replay = OneStepReplay(before, run)
    first = replay.acceleration()
    before.effect(name).load_state_dict(model.effect(name).state_dict())
    replay.update(before.effect(name).hooks())
    np.testing.assert_array_equal(replay.acceleration(), OneStepReplay(model, run).acceleration())
    assert np.nanmax(np.abs(replay.acceleration() - first)) > 1e-4


def test_scores_are_the_usual_ones(moving):
    _, log = moving
    part = one_step(GreyBox(small_vehicle(mass=60.0, buoyancy=588.6)), log, choose_derivative(log))
    measured = np.concatenate([p.measured for p in part])
    predicted = np.concatenate([p.model for p in part])
    for k, value in enumerate(scores(part).values()):
        assert value["rmse"] == pytest.approx(
            np.linalg.norm(measured[:, k] - predicted[:, k]) / np.sqrt(len(measured))
        )
        assert value["r2"] == pytest.approx(
            1
            - np.var(measured[:, k] - predicted[:, k]) / np.var(measured[:, k])
            - np.mean(measured[:, k] - predicted[:, k]) ** 2 / np.var(measured[:, k])
        )
    assert min(v["r2"] for v in scores(part).values()) < 0.99


def test_the_noise_floor_is_what_noise_alone_leaves():
    t = np.arange(0, 120.0, 0.05)
    force = 30 * np.stack([np.sin(0.9 * t) + np.sin(0.37 * t), 0.1 * np.sin(0.7 * t)], 1)
    clean, noisy = (simple.log(t, force, noise=n, start=(0, 0)) for n in (0.0, 0.01))
    how = choose_derivative(clean)
    part, quiet = (one_step(simple.model(), log, how)[0] for log in (noisy, clean))
    for column in (simple.SURGE, simple.ROLL):
        realised = np.std((part.measured - part.model)[:, column])
        assert part.noise[column] == pytest.approx(realised, rel=0.1)
        assert part.wrench_noise[column] == pytest.approx(np.std(part.wrench[:, column]), rel=0.1)
        assert quiet.noise[column] < 0.01 * realised


def test_the_noise_floor_counts_what_a_noisy_attitude_does_to_the_models_restoring_moment():
    """At rest, level and neutrally buoyant: B z_b times a white roll angle is all that the model makes of noise."""
    t, random = np.arange(0, 150.0, 0.05), np.random.default_rng(3)
    roll = 0.01 * random.normal(size=len(t))
    nu = 0.01 * random.normal(size=(len(t), 6))
    quaternion = np.stack([np.cos(roll / 2), np.sin(roll / 2), 0 * t, 0 * t], 1)
    log = Log.from_runs([Run(0, t, quaternion, nu, wrench=np.zeros((len(t), 6)))])
    model = simple.model(linear=(0.0, 0.0), quadratic=(0.0, 0.0), center_of_buoyancy=[0, 0, -0.05])
    part = one_step(model, log, choose_derivative(log))[0]
    slopes = savgol_coeffs(9, 2, deriv=1, delta=0.05)
    velocity = simple.ROLL_INERTIA * 0.01 * np.linalg.norm(slopes)
    # The slope of a sum: each white sample counts by the filter's weights from there on.
    restoring = 490.5 * 0.05 * 0.01 * np.linalg.norm(np.cumsum(slopes)) * 0.05
    expected = np.hypot(velocity, restoring)
    assert restoring > velocity / 2
    assert part.wrench_noise[3] == pytest.approx(expected, rel=0.1)
    assert np.std(part.wrench[:, 3]) == pytest.approx(expected, rel=0.1)


def test_the_bandwidth_is_where_scipys_filter_loses_three_decibels():
    log = simple.log(T, simple.steps(T))
    for options in ({}, {"half_width": 7, "order": 3}):
        how = choose_derivative(log, options)
        width = 2 * how.half_width + 1
        omega, gain = freqz(savgol_coeffs(width, how.order, deriv=1, delta=0.05), worN=20000, fs=20.0)
        relative = np.abs(gain[1:]) / (2 * np.pi * omega[1:])
        cut = omega[1:][relative < np.sqrt(0.5)][0]
        assert how.describe(0.05)["bandwidth_hz"] == pytest.approx(cut, rel=2e-3)


def test_the_window_is_nine_samples_or_a_fifth_of_a_second_either_side():
    assert choose_derivative(simple.log(T, simple.steps(T))).half_width == 4
    fast = np.arange(0, 2.0, 0.005)
    assert choose_derivative(simple.log(fast, simple.steps(fast))).half_width == 40


def test_options_of_the_derivative_are_refused_where_they_make_no_sense(stepped):
    with pytest.raises(ConfigError, match=r"derivative option.*'halfwidth'.*Did you mean 'half_width'"):
        choose_derivative(stepped, {"halfwidth": 3})
    with pytest.raises(ConfigError, match=r"derivative method.*'savgol'"):
        choose_derivative(stepped, {"method": "savgol"})
    with pytest.raises(InputError, match=r"no columns du \.\.\. dr.*local_polynomial"):
        choose_derivative(stepped, {"method": "measured"})
    with pytest.raises(ConfigError, match="order"):
        one_step(simple.model(), stepped, choose_derivative(stepped, {"half_width": 1, "order": 5}))
    assert choose_derivative(stepped, {"method": None, "order": 3}).order == 3


def test_commands_that_do_not_drive_the_model_are_refused(moving, stepped):
    model, log = moving
    with pytest.raises(InputError, match="no commands of the kind that drives the model"):
        OneStepReplay(model, stepped.runs[0]).acceleration()
    run = log.runs[0]
    fewer = Run(0, run.t, run.quaternion, run.nu, thrusters=run.thrusters[:, :5])
    with pytest.raises(InputError, match="5 thruster columns, but small has 8 thrusters"):
        OneStepReplay(model, fewer).acceleration()


@pytest.mark.parametrize(("rows", "batches"), [(20_000, [2, 1, 1]), (70, [1, 1, 1, 1])])
def test_runs_asked_together_say_what_each_says_alone(rows, batches, monkeypatch):
    """Also where one of them has an altitude and the others do not, and where they do not fit in one batch."""
    monkeypatch.setattr(replay, "ROWS", rows)
    model = GreyBox(small_vehicle()).with_effects({"thruster_lag": {"time_constant": 0.3}})
    log = make_log(model, runs=4, duration=3.0, rate=20.0)
    runs, how = [r.cleaned for r in log.runs], choose_derivative(log)
    runs[2] = dataclasses.replace(runs[2], altitude=np.linspace(3.0, 5.0, len(runs[2].t)))
    replays = [OneStepReplay(model, r) for r in runs]
    assert [len(b) for b in replay._batches(replays)] == batches
    together = LogComparison.of(model, runs, how)
    alone = [RunComparison(model, run, how) for run in runs]
    np.testing.assert_allclose(
        together.predicted(), np.concatenate([a.predicted() for a in alone]), atol=1e-12
    )
    np.testing.assert_allclose(
        together.gap(), np.concatenate([a.measured - a.predicted() for a in alone]), atol=1e-12
    )
    for a, b in zip(replay.accelerations(replays), [r.acceleration() for r in replays], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
