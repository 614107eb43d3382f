"""Windows: where they start and end, what they never cross, their history and their padding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.errors import InputError
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.windows import CHANNELS, VELOCITY, cut_windows
from auvnn.models import GreyBox
from auvnn.vehicle import load_vehicle
from tests.small_logs import make_log, small_vehicle


def plain_run(t, number=0, **changes) -> Run:
    """Return a run whose every number says which row it is."""
    n = len(t)
    row = np.arange(n, dtype=float)[:, None]
    quaternion = np.stack(
        [np.cos(row[:, 0] / 1000), 0 * row[:, 0], 0 * row[:, 0], np.sin(row[:, 0] / 1000)], 1
    )
    data = {"quaternion": quaternion, "nu": row + np.arange(6) / 10, "wrench": 1000 * row + np.arange(6)}
    return Run(number, t, **{**data, **changes})


def log_of(*runs) -> Log:
    return Log.from_runs(runs)


def spans(windows):
    return [
        (int(r), int(a), int(a + n - 1))
        for r, a, n in zip(windows.run, windows.first, windows.length, strict=True)
    ]


def test_windows_start_every_stride_and_last_the_horizon():
    t = np.arange(0, 10.05, 0.1)
    assert len(t) == 101
    windows = cut_windows(log_of(plain_run(t)), 2.0, 1.0)
    assert spans(windows) == [(0, 10 * k, 10 * k + 20) for k in range(9)]
    assert spans(cut_windows(log_of(plain_run(t)), 2.0)) == [(0, 20 * k, 20 * k + 20) for k in range(5)]
    assert spans(cut_windows(log_of(plain_run(t)), np.inf)) == [(0, 0, 100)]


def test_windows_hold_the_rows_of_the_log():
    t = np.arange(0, 6.0, 0.1)
    windows = cut_windows(log_of(plain_run(t), plain_run(t + 3, number=4)), 2.0, 2.0, warmup=0.5)
    assert windows.warmup == 5 and list(windows.run) == [0, 0, 4, 4]
    second = windows.pick(slice(1, 2))
    np.testing.assert_array_equal(second.nu[0, :, 0], np.arange(20, 41))
    np.testing.assert_array_equal(second.inputs.command[0, :, 0], 1000 * np.arange(15, 41))
    np.testing.assert_allclose(second.times[0], t[15:41])
    assert second.inputs.command.shape == (1, 26, 6) and second.mask.shape == (1, 21, 18)
    picked = windows.pick(np.array([2]))
    assert list(picked.run) == [4] and picked.times[0, -1] == pytest.approx(5.0)


def test_before_the_run_its_first_row_is_held():
    t = np.arange(0, 6.0, 0.1) + 7.0
    windows = cut_windows(log_of(plain_run(t)), 2.0, warmup=0.5)
    np.testing.assert_array_equal(windows.inputs.command[0, :6, 0], np.zeros(6))
    np.testing.assert_allclose(windows.times[0, :6], 7.0 + np.arange(-5, 1) / 10)
    np.testing.assert_array_equal(windows.inputs.command[0, 6:8, 0], [1000, 2000])


def test_windows_never_cross_a_gap():
    t = np.concatenate([np.arange(0, 3.05, 0.1), np.arange(5.0, 8.05, 0.1)])
    windows = cut_windows(log_of(plain_run(t)), 2.0, 1.0)
    assert spans(windows) == [(0, 0, 20), (0, 10, 30), (0, 31, 51), (0, 41, 61)]


@pytest.mark.parametrize("kind", ["wrench", "fins"])
def test_windows_never_cross_a_row_without_inputs_and_its_history_ends_there(kind):
    t = np.arange(0, 8.05, 0.1)
    values = {"wrench": np.tile(np.arange(len(t), dtype=float)[:, None], 6), "fins": np.zeros((len(t), 2))}
    values[kind][30, 1] = np.nan
    windows = cut_windows(log_of(plain_run(t, **values)), 2.0, 1.0, warmup=0.5)
    for _, first, last in spans(windows):
        assert not first <= 30 <= last
    assert spans(windows)[:4] == [(0, 0, 20), (0, 31, 51), (0, 41, 61), (0, 51, 71)]
    assert bool(torch.isfinite(windows.inputs.command).all()) and bool(
        torch.isfinite(windows.inputs.fins).all()
    )
    after = windows.pick(slice(1, 2))
    np.testing.assert_array_equal(after.inputs.command[0, :7, 0], [31, 31, 31, 31, 31, 31, 32])
    np.testing.assert_allclose(after.times[0, :6], 3.1 + np.arange(-5, 1) / 10)


def test_a_lag_survives_a_lost_command_and_a_finned_vehicle_a_lost_angle():
    t = np.arange(0, 6.05, 0.1)
    vehicle = load_vehicle("remus100")
    still = {
        "quaternion": np.tile([1.0, 0, 0, 0], (len(t), 1)),
        "nu": np.tile([1.0, 0, 0, 0, 0, 0], (len(t), 1)),
        "wrench": np.zeros((len(t), 6)),
        "fins": np.zeros((len(t), len(vehicle.fins))),
    }
    still["wrench"][20] = np.nan
    still["fins"][45] = np.nan
    model = GreyBox(vehicle, actuation="wrench").with_effects({"thruster_lag": {"time_constant": 0.3}})
    windows = cut_windows(log_of(plain_run(t, **still)), 1.0, warmup=2.0)
    assert len(windows) >= 4
    with torch.no_grad():
        eta, nu = predict(model, windows, initial_states(model, windows))
    assert bool(torch.isfinite(eta).all()) and bool(torch.isfinite(nu).all())


def test_windows_start_where_the_state_was_measured_and_mask_what_was_not():
    t = np.arange(0, 6.05, 0.1)
    run = plain_run(t)
    nu, quaternion = run.nu.copy(), run.quaternion.copy()
    nu[0:3, 2] = np.nan
    nu[9, 4] = np.nan
    quaternion[12] = np.nan
    windows = cut_windows(log_of(plain_run(t, nu=nu, quaternion=quaternion)), 2.0, 2.0)
    assert spans(windows)[0] == (0, 3, 23)
    mask = windows.mask[0].numpy()
    lost = [(i + 3, CHANNELS[c]) for i, c in zip(*np.nonzero(mask[:, 3:12] == 0), strict=True)]
    assert [(i, CHANNELS[CHANNELS.index(n) + 3]) for i, n in lost] == [
        (9, "q"),
        (12, "phi"),
        (12, "theta"),
        (12, "psi"),
    ]
    assert mask[:, :3].sum() == 0 and mask[:, 12:].sum() == 0
    assert not windows.has_position and windows.nu_dot is None
    assert float(windows.nu[0, 6, 4]) == 0.0 and bool(torch.isfinite(windows.eta).all())


def test_a_spike_does_not_count():
    t = np.arange(0, 6.05, 0.1)
    nu = np.sin(np.outer(t, np.arange(1, 7) / 3))
    nu[25, 3] += 5.0
    windows = cut_windows(log_of(plain_run(t, nu=nu)), np.inf)
    missing = np.argwhere(windows.mask[0, :, VELOCITY].numpy() == 0)
    np.testing.assert_array_equal(missing, [[25, 3]])


def test_a_shorter_window_is_padded_with_its_last_row_at_rest_in_time():
    t = np.arange(0, 5.05, 0.1)
    log = log_of(plain_run(t))
    assert spans(cut_windows(log, 2.0)) == [(0, 0, 20), (0, 20, 40)]
    assert spans(cut_windows(log, 3.5, partial=True)) == [(0, 0, 35)]
    windows = cut_windows(log, 3.0, partial=True)
    assert spans(windows) == [(0, 0, 30), (0, 30, 50)]
    assert windows.times[1, -1] == windows.times[1, 20] == pytest.approx(5.0)
    assert windows.mask[1, 20, 6] == 1 and windows.mask[1, 21:].sum() == 0
    np.testing.assert_array_equal(windows.nu[1, 20:, 0], np.full(11, 50.0))


def test_uneven_stamps_still_give_windows_of_the_horizon():
    random = np.random.default_rng(2)
    t = np.arange(0, 20.0, 0.1) + random.uniform(-0.03, 0.03, 200)
    windows = cut_windows(log_of(plain_run(t)), 2.0, 1.0)
    for _, first, last in spans(windows):
        assert 1.85 < t[last] - t[first] <= 2.0 + 1e-3
    assert len(windows) in (17, 18)


def test_nothing_to_cut_is_said():
    t = np.arange(0, 3.0, 0.1)
    with pytest.raises(
        InputError, match=r"no stretch of .* is 5 s long without a gap: choose a shorter horizon"
    ):
        cut_windows(log_of(plain_run(t)), 5.0)
    with pytest.raises(InputError, match=r"run 0 has no thruster_1"):
        cut_windows(log_of(plain_run(t)), 1.0, kind="thrusters")


def test_windows_start_at_new_velocities_and_old_ones_do_not_count():
    log = slow_velocities(make_log(GreyBox(small_vehicle()), runs=1, duration=20.0, rate=20.0))
    # A stride of 23 rows would begin at old velocities.
    windows = cut_windows(log, 2.0, 1.15)
    assert (windows.first % 4 == 0).all() and len(windows) >= 8
    seen = windows.mask.numpy().mean((0, 1))
    assert seen[6:9] == pytest.approx(0.25, abs=0.02) and (seen[9:12] > 0.95).all()


def test_sensors_out_of_step_leave_windows_all_the_same():
    log = slow_velocities(make_log(GreyBox(small_vehicle()), runs=1, duration=20.0, rate=20.0))
    run = log.runs[0]
    old = np.arange(run.samples) % 4 != 1
    quaternion = np.where(old[:, None], np.nan, run.quaternion)
    windows = cut_windows(Log.from_runs([replace(run, quaternion=quaternion)], name="out of step"), 2.0)
    assert len(windows) >= 8 and (windows.first % 4 == 1).all()


def slow_velocities(log: Log) -> Log:
    """Return a log whose velocities are measured at every fourth row and repeated in between."""
    runs = []
    for run in log.runs:
        nu = run.nu.copy()
        nu[:, :3] = run.nu[np.arange(run.samples) // 4 * 4, :3]
        runs.append(replace(run, nu=nu))
    return Log.from_runs(runs, name=log.name)
