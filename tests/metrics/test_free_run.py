"""Free runs from windows: initial states, and moving them by a little."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from auvnn.effects import Sensed
from auvnn.metrics.free_run import away, initial_states, moved, predict
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


def test_states_move_by_a_turn_about_the_bodys_own_axes():
    random = np.random.default_rng(0)
    quaternion = random.normal(size=(5, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    state = np.concatenate([random.normal(size=(5, 3)), quaternion, random.normal(size=(5, 6))], 1)
    change = random.normal(size=(5, 12))
    found = moved(torch.tensor(state), torch.tensor(change)).numpy()
    np.testing.assert_allclose(found[:, :3], state[:, :3] + change[:, :3])
    np.testing.assert_allclose(found[:, 7:], state[:, 7:] + change[:, 6:])
    turned = Rotation.from_quat(state[:, 3:7], scalar_first=True) * Rotation.from_rotvec(change[:, 3:6])
    np.testing.assert_allclose(
        turned.as_matrix(), Rotation.from_quat(found[:, 3:7], scalar_first=True).as_matrix(), atol=1e-12
    )
    # The way back: turns of less than half a revolution come back as they were.
    small = torch.tensor(0.5 * change)
    np.testing.assert_allclose(
        away(torch.tensor(state), moved(torch.tensor(state), small)), small, atol=1e-12
    )


def test_initial_states_are_what_the_sensors_would_report_as_measured():
    model = GreyBox(small_vehicle()).with_effects({"velocity_lever_arm": {"x": 0.3, "y": 0.1, "z": -0.2}})
    log = make_log(model, runs=1, duration=6.0)
    windows = cut_windows(log, 2.0)
    states = initial_states(model, windows)
    seen = model.sense(Sensed(states[:, :3], states[:, 3:7], states[:, 7:]))
    np.testing.assert_allclose(seen.nu.detach(), windows.nu[:, 0], atol=1e-12)
    assert float((states[:, 7:] - windows.nu[:, 0]).abs().max()) > 0.01


def test_a_perfect_model_runs_back_over_its_own_log_warmup_included():
    model = GreyBox(small_vehicle()).with_effects({"thruster_lag": {"time_constant": 0.25}})
    log = make_log(model, runs=2, duration=12.0)
    windows = cut_windows(log, 3.0, 1.5, warmup=3.0)
    with torch.no_grad():
        eta, nu = predict(model, windows, initial_states(model, windows))
        forgetful = cut_windows(log, 3.0, 1.5, warmup=0.0)
        _, without = predict(model, forgetful, initial_states(model, forgetful))
    seen = windows.mask[..., 6:12] > 0
    assert float((nu - windows.nu)[seen].abs().max()) < 2e-4
    assert float((eta[..., :3] - windows.eta[..., :3]).abs().max()) < 2e-4
    assert float((without - windows.nu)[seen].abs().max()) > 5e-3
