"""The table of free-running errors against scipy: windows, cuts, persistence, channels that do not move."""

from __future__ import annotations

import numpy as np
import pytest

import tests.metrics.surge_and_roll as simple
from auvnn.logs import Log, Run
from auvnn.metrics.rollouts import HORIZONS, NAMES, roll, rollout_table, scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

T = np.arange(0, 24.05, 0.1)
WRONG = {"linear": (22.0, 5.0), "quadratic": (60.0, 6.0)}


@pytest.fixture(scope="module")
def log():
    """Two runs of the simple vehicle, a little noisy."""
    runs = [
        simple.log(
            T, simple.steps(T, seed), noise=0.003, seed=seed, start=(0.2, 0.1 * seed), number=seed
        ).runs[0]
        for seed in (1, 2)
    ]
    return Log.from_runs(runs)


@pytest.fixture(scope="module")
def by_hand(log):
    """Errors of the wrong model and of holding the speed, by horizon: lists of (window, samples, 2)."""
    out = {}
    for horizon in (1.0, 2.0, 5.0):
        wrong, held = [], []
        length = round(horizon / 0.1)
        for run in log.runs:
            for first in range(0, len(T) - length, length // 2):
                rows = slice(first, first + length + 1)
                y = run.nu[rows][:, [simple.SURGE, simple.ROLL]]
                force = run.wrench[rows][:, [simple.SURGE, simple.ROLL]]
                free = simple.run_free(T[rows], y[0], force, **WRONG)
                wrong.append((y - free)[1:])
                held.append((y - y[0])[1:])
        out[f"{horizon:g}"] = np.array(wrong), np.array(held)
    return out


@pytest.fixture(scope="module")
def found(log):
    return rollout_table(simple.model(**WRONG), log, scale_of(log), ("1", "2", "5", "full"))


def std_of(log):
    return np.std(np.concatenate([run.nu for run in log.runs])[:, [simple.SURGE, simple.ROLL]], axis=0)


@pytest.mark.parametrize("horizon", ["1", "2", "5"])
def test_the_table_equals_scipys_free_runs(log, by_hand, found, horizon):
    wrong, held = by_hand[horizon]
    row, std = found[0][horizon], std_of(log)
    assert row["windows"] == len(wrong) and row["diverged"] == 0
    rmse = np.sqrt(np.mean(wrong**2, axis=(0, 1)))
    assert [row[n]["rmse"] for n in "up"] == pytest.approx(rmse, rel=1e-4)
    assert [row[n]["nrmse"] for n in "up"] == pytest.approx(rmse / std, rel=1e-4)
    assert row["total"] == pytest.approx(np.mean(rmse / std), rel=1e-4)
    assert row["persistence"] == pytest.approx(
        np.mean(np.sqrt(np.mean(held**2, axis=(0, 1))) / std), rel=1e-6
    )
    assert row["total"] < row["persistence"]


def test_channels_that_do_not_move_have_no_relative_error(found):
    for horizon in found[0].values():
        for name in "vwqr":
            assert np.isnan(horizon[name]["nrmse"]) and horizon[name]["rmse"] < 0.02


def test_a_channel_counts_as_excited_from_three_times_its_noise(log):
    t, random = np.arange(0, 60, 0.05), np.random.default_rng(5)
    nu = 0.01 * random.normal(size=(len(t), 6))
    for k, size in enumerate((0.0, 0.01, 0.02, 0.05, 0.1, 0.2)):
        nu[:, k] += size * np.sqrt(2) * np.sin(0.5 * t)
    scale = scale_of(Log.from_runs([Run(0, t, np.tile([1.0, 0, 0, 0], (len(t), 1)), nu, wrench=0 * nu)]))
    np.testing.assert_array_equal(scale.excited, [False, False, False, True, True, True])
    np.testing.assert_allclose(scale.std, nu.std(0))
    assert list(scale_of(log).excited) == [True, False, False, True, False, False]


def test_full_runs_over_the_whole_stretch(log, found):
    wrong = []
    for run in log.runs:
        y = run.nu[:, [simple.SURGE, simple.ROLL]]
        wrong.append((y - simple.run_free(T, y[0], run.wrench[:, [simple.SURGE, simple.ROLL]], **WRONG))[1:])
    row = found[0]["full"]
    assert row["windows"] == 2
    assert [row[n]["rmse"] for n in "up"] == pytest.approx(
        np.sqrt(np.mean(np.square(wrong), axis=(0, 1))), rel=1e-4
    )


def test_a_diverged_window_counts_as_ten_standard_deviations(log):
    """A push of 1e5 N on 70 kg without drag passes what is physical before the first sample, and takes roll along."""
    model = simple.model(linear=(0, 4), quadratic=(0, 6)).with_effects({"constant_force": {"X": 1e5}})
    rows, kept = rollout_table(model, log, scale_of(log), ("2",))
    row = rows["2"]
    assert row["diverged"] == row["windows"] == len(kept["2"].windows)
    assert row["u"]["nrmse"] == pytest.approx(10.0) and row["p"]["nrmse"] == pytest.approx(10.0)
    assert row["total"] == pytest.approx(10.0)
    assert np.isnan(kept["2"].predicted[:, 1:]).all()


def test_only_what_comes_after_the_divergence_is_cut(log):
    """2100 N on 70 kg without drag: 100 m/s after 3.3 s, ten standard deviations of the motion long before."""
    model = simple.model(linear=(0.0, 4.0), quadratic=(0.0, 6.0)).with_effects(
        {"constant_force": {"X": 70 * 30.0}}
    )
    rows, kept = rollout_table(model, log, scale_of(log), ("5",))
    rolled, std = kept["5"], scale_of(log).std
    assert rolled.diverged.all()
    free = rolled.predicted[0]
    sound = np.isfinite(free[:, 0])
    assert 30 <= sound.sum() <= 35 and np.nanmax(free) < 100
    windows = rolled.windows
    error = np.abs(windows.nu[0, :, 0].numpy() - free[:, 0])
    by_hand = np.sum(np.where(sound, np.minimum(error, 10 * std[0]), 10 * std[0])[1:] ** 2)
    assert rolled.squared[0, 0] == pytest.approx(by_hand)
    # Roll is sound as long as surge is, and is not cut before.
    assert rows["5"]["p"]["nrmse"] < 10


def test_horizons_longer_than_any_stretch_are_unknown_and_never_left_out():
    t = np.arange(0, 3.0, 0.1)
    log = simple.log(t, simple.steps(t))
    rows, kept = rollout_table(simple.model(), log, scale_of(log))
    assert list(rows) == list(HORIZONS)
    for horizon in ("5", "10"):
        assert rows[horizon]["total"] is None and rows[horizon]["u"] == {"rmse": None, "nrmse": None}
        assert rows[horizon]["windows"] == 0 and horizon not in kept
    assert rows["2"]["total"] is not None


def test_a_gap_or_a_lost_command_only_takes_the_windows_that_would_cross_it(log):
    run = log.runs[0]
    wrench = run.wrench.copy()
    wrench[100] = np.nan
    torn = Log.from_runs([Run(1, run.t, run.quaternion, run.nu, wrench=wrench)])
    whole = Log.from_runs([run])
    scale = scale_of(log)
    model = simple.model(**WRONG)
    part, full = roll(model, torn, "2", scale), roll(model, whole, "2", scale)
    shared = [(int(a), b) for b, a in enumerate(part.windows.first) if a < 80]
    for first, b in shared:
        other = int(np.flatnonzero(full.windows.first == first)[0])
        np.testing.assert_allclose(part.squared[b], full.squared[other])
    assert all(not a <= 100 <= a + 20 for a in part.windows.first)
    assert np.isfinite(part.squared).all()


def test_the_whole_table_of_a_vehicle_that_does_everything_is_near_zero_for_its_own_log():
    model = GreyBox(small_vehicle())
    log = make_log(model, runs=1, duration=12.0)
    rows, _ = rollout_table(model, log, scale_of(log))
    for horizon in ("0.5", "1", "2", "5", "10", "full"):
        assert rows[horizon]["total"] < 1e-3 < rows[horizon]["persistence"]
        assert all(np.isfinite(rows[horizon][n]["nrmse"]) for n in NAMES)
