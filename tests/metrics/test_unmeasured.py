"""Logs without sensors for some of the motion: estimates to start from, and nothing else that counts."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.comparison import compare
from auvnn.errors import ConfigError, InputError
from auvnn.estimation.prediction_error import fit
from auvnn.estimation.priors import Priors
from auvnn.logs import Log
from auvnn.logs.without_sensors import without
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.likely_states import likely_states
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.metrics.windows import CHANNELS, cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NO_DVL = ("u", "v", "w", "x", "y")


@pytest.fixture(scope="module")
def model() -> GreyBox:
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def whole(model: GreyBox) -> Log:
    return make_log(model, runs=2, duration=30.0, rate=10.0, seed=3)


@pytest.fixture(scope="module")
def log(model: GreyBox, whole: Log) -> Log:
    return completed(model, without(whole, NO_DVL))


def test_a_log_with_every_channel_stays_the_same_object(model, whole):
    assert completed(model, whole) is whole
    assert without(whole, ()) is whole
    assert assumed(whole, model) == []


def test_the_observer_finds_velocities_that_nobody_measured(model, whole, log):
    for run, truth in zip(log.runs, whole.runs, strict=True):
        settled = run.t > 8.0
        off = np.sqrt(np.mean((run.nu - truth.nu)[settled, :3] ** 2, axis=0))
        assert (off < 0.05 * truth.nu[:, :3].std(0) + 0.005).all()
        np.testing.assert_array_equal(run.nu[:, 3:], truth.nu[:, 3:])


def test_estimates_are_marked_and_the_recording_is_kept(log):
    assert log.estimated == ("u", "v", "w")
    assert log.unmeasured == ["u", "v", "w"]
    part = log.runs[0].cut(slice(10, 40))
    assert np.isnan(part.measured.nu[:, :3]).all() and len(part.measured.t) == 30
    assert "u" not in log.runs[0].channels and "z" in log.runs[0].channels
    assert "u, v, w not measured" in assumed(log)[0]


def test_windows_start_from_estimates_and_do_not_count_them(model, log, whole):
    windows = cut_windows(log, 5.0)
    names = [n for n, seen in zip(CHANNELS, windows.mask.sum((0, 1)), strict=True) if seen > 0]
    assert names == ["z", "phi", "theta", "psi", "p", "q", "r"]
    assert float(windows.nu[:, 0, :3].abs().max()) > 0.0


def test_likely_states_find_the_start_that_the_window_speaks_for(model, log, whole):
    windows, truth = cut_windows(log, 5.0, 5.0), cut_windows(whole, 5.0, 5.0)
    wrong = windows.nu.clone()
    wrong[:, 0, :3] += torch.tensor([0.05, -0.05, 0.05])
    windows.nu.copy_(wrong)
    before = (initial_states(model, windows)[:, 9] - truth.nu[:, 0, 2]).abs()
    after = (likely_states(model, windows)[:, 9] - truth.nu[:, 0, 2]).abs()
    assert float(after.max()) < 0.1 * float(before.min())
    measured = initial_states(model, windows)[:, [2, 10, 11, 12]]
    torch.testing.assert_close(likely_states(model, windows)[:, [2, 10, 11, 12]], measured)


def test_a_whole_log_needs_no_likely_states(model, whole):
    windows = cut_windows(whole, 5.0)
    assert torch.equal(likely_states(model, windows), initial_states(model, windows))


def test_scores_count_what_was_measured_and_depth_in_the_place_of_heave(model, log):
    scale = scale_of(log)
    assert scale.names == ("u", "v", "z", "p", "q", "r")
    assert scale.excited.tolist() == [False, False, True, True, True, True]
    rolled = roll(model, log, "5", scale)
    assert rolled is not None and rolled.total(scale) < 0.02
    assert rolled.total(scale, held=True) > 0.5
    heavy = model.with_effects({"net_buoyancy": {"force": -8.0}})
    worse = roll(heavy, log, "5", scale)
    assert worse is not None and worse.nrmse(scale)[2] > 10 * rolled.nrmse(scale)[2]


def test_a_hidden_net_buoyancy_is_estimated_from_depth_and_attitude(model):
    truth = model.with_effects({"net_buoyancy": {"force": 3.0}})
    made = make_log(truth, runs=2, duration=30.0, rate=10.0, noise=1.0, seed=5)
    log = completed(model, without(made, NO_DVL))
    asked = model.with_effects(["net_buoyancy"])
    found = fit(asked, cut_windows(log, 10.0), ["net_buoyancy"], Priors(np.zeros(1), np.full(1, 1e-4)))
    std = float(np.sqrt(found.covariance()[0, 0]))
    assert abs(found.theta[0] - 3.0) < max(4 * std, 0.05) and std < 0.5
    assert np.isinf(found.sigma[[0, 1, 6, 7, 8]]).all()


def test_a_comparison_says_nothing_of_what_has_no_sensor(model, log):
    found = compare(model, without(log.measured, ()), horizons=["5"])
    data = found.to_dict()
    assert [data["one_step"][n]["r2"] for n in ("du", "dv", "dw")] == [None] * 3
    assert data["one_step"]["dr"]["r2"] > 0.95
    assert data["residual_wrench"]["Z"]["rms"] is None and data["residual_wrench"]["N"]["rms"] is not None
    assert data["rollout"]["5"]["z"]["nrmse"] < 0.02 and data["rollout"]["5"]["u"]["nrmse"] is None
    assert data["baseline"] == {}
    assert any("surge, sway not seen directly" in w for w in data["warnings"])
    assert any("velocity_scale" in w for w in data["warnings"])


def test_a_tracked_vehicle_has_a_course_and_rates(model, whole):
    log = completed(model, without(whole, ("u", "v", "w", "p", "q", "r", "attitude")))
    assert set(log.estimated) == {"u", "v", "w", "p", "q", "r", "phi", "theta", "psi"}
    run = log.runs[0]
    assert np.isfinite(run.nu).all() and np.abs(run.euler[:, :2]).max() < 1e-9
    windows = cut_windows(log, 5.0)
    names = [n for n, seen in zip(CHANNELS, windows.mask.sum((0, 1)), strict=True) if seen > 0]
    assert names == ["x", "y", "z"]
    assert scale_of(log).names == ("x", "y", "z", "p", "q", "r")


def test_rates_follow_from_attitudes(model, whole):
    log = completed(model, without(whole, ("p", "q", "r")))
    off = log.runs[0].nu[5:-5, 3:] - whole.runs[0].nu[5:-5, 3:]
    assert np.sqrt(np.mean(off**2)) < 0.1 * whole.runs[0].nu[:, 3:].std()


def test_neither_attitude_nor_position_is_refused(model, whole):
    with pytest.raises(InputError, match="neither attitude nor position"):
        completed(model, without(whole, ("attitude", "x", "y", "z")))


def test_a_log_cannot_lack_its_time(whole):
    with pytest.raises(ConfigError, match="channel that a log can lack"):
        without(whole, ("t",))
