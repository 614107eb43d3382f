"""Reduced models and what drives a glider, against forces and steady speeds worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.errors import InputError, ModelError
from auvnn.logs import Log, Run
from auvnn.logs.signals.rotation import from_euler, to_euler
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

DRAG = {"quadratic_damping": [10.0, 80.0, 100.0, 1.0, 1.0, 1.0]}
GLIDER = {
    **DRAG,
    "reduced": {"plane": "vertical", "attitude": "measured"},
    "ballast": {"position": [0.2, 0.0, 0.0]},
}


def glide(pitch: np.ndarray, ballast: np.ndarray, step: float = 1.0, **more: np.ndarray) -> Log:
    """Return a log of pitch, depth and ballast alone; the depth only says where it starts."""
    count = len(pitch)
    angles = np.stack([np.zeros(count), pitch, np.zeros(count)], axis=1)
    position = np.full((count, 3), np.nan)
    position[:, 2] = 20.0
    run = Run(
        0, step * np.arange(count), from_euler(angles), np.full((count, 6), np.nan), position=position, ballast=ballast,
        **more,
    )  # fmt: skip
    return Log.from_runs([run])


def final(model: GreyBox, log: Log) -> tuple[np.ndarray, np.ndarray]:
    """Return depth rate (L,) and pitch (L,) of free running over the whole log from rest."""
    windows = cut_windows(completed(model, log), np.inf, kind="wrench")
    start = initial_states(model, windows)
    start[:, 7:10] = 0.0
    eta, nu = predict(model, windows, start, 1.0)
    pitch = to_euler(eta[0, :, 3:].detach().numpy())[:, 1]
    u, w = nu[0, :, 0].detach().numpy(), nu[0, :, 2].detach().numpy()
    return -np.sin(pitch) * u + np.cos(pitch) * w, pitch


def test_ballast_sinks_at_the_speed_at_which_drag_holds_its_weight():
    """Level: rho g dV = D w |w|; -20 cm3 in 1000 kg/m3 weigh 0.1962 N, and sqrt(0.1962 / 100) is 0.0443 m/s."""
    model = GreyBox(plain_vehicle(**GLIDER))
    rate, _ = final(model, glide(np.zeros(200), np.full(200, -20e-6)))
    assert rate[-1] == pytest.approx(np.sqrt(1000.0 * 9.81 * 20e-6 / 100.0), rel=1e-3)


def test_denser_water_lifts_the_whole_volume():
    """1 kg/m3 more on 0.05 m3 lifts by 0.4905 N: up at sqrt(0.4905 / 100) m/s; the ballast displaces it as well."""
    model = GreyBox(plain_vehicle(**GLIDER))
    log = glide(np.zeros(200), np.zeros(200), density=np.full(200, 1001.0))
    rate, _ = final(model, log)
    assert rate[-1] == pytest.approx(-np.sqrt(0.4905 / 100.0), rel=1e-3)


def test_a_pitched_glider_goes_forward_as_the_forces_along_its_axes_say():
    """At pitch -30 deg, weight F: D_x u^2 = F sin 30, D_z w^2 = F cos 30, no lift."""
    model = GreyBox(plain_vehicle(**GLIDER))
    theta, force = -np.pi / 6, 9.81 * 0.2
    rate, pitch = final(model, glide(np.full(300, theta), np.full(300, -200e-6)))
    u, w = np.sqrt(force * 0.5 / 10.0), np.sqrt(force * np.cos(theta) / 100.0)
    assert rate[-1] == pytest.approx(0.5 * u + np.cos(theta) * w, rel=1e-3)
    np.testing.assert_allclose(pitch, theta, atol=1e-9)


def test_the_measured_attitude_turns_the_vehicle_and_no_error_grows():
    t = np.cumsum(np.random.default_rng(1).uniform(0.6, 1.4, 300))
    pitch = 0.4 * np.sin(0.05 * t)
    log = glide(pitch, np.zeros(300))
    run = log.runs[0]
    log = Log.from_runs([Run(**{**vars(run), "t": t})])
    _, followed = final(GreyBox(plain_vehicle(**GLIDER)), log)
    assert np.abs(followed - pitch).max() < 2e-3
    assert np.abs(followed - pitch)[-50:].max() < 2e-3


def test_a_moving_mass_pitches_the_vehicle_by_its_weight_times_its_shift():
    """5 kg shifted 0.1 m ahead: a moment of -5 * 9.81 * 0.1 about y, nose down."""
    changes = {"moving_mass": {"mass": 5.0}, "center_of_gravity": [0.0, 0.0, 0.05]}
    model = GreyBox(plain_vehicle(**DRAG, **changes))
    log = glide(np.zeros(20), np.zeros(20), moving_mass=np.full(20, 0.1))
    wrench = completed(model, log).runs[0].wrench
    np.testing.assert_allclose(wrench[:, 4], -5.0 * 9.81 * 0.1)
    np.testing.assert_allclose(wrench[:, [0, 1, 2, 3, 5]], 0.0, atol=1e-12)


def test_ballast_ahead_of_the_origin_lifts_the_nose():
    """0.2 m ahead of the origin, a lift of 9.81e-2 N turns the nose up: M = 0.2 * 9.81e-2."""
    model = GreyBox(plain_vehicle(**DRAG, ballast={"position": [0.2, 0.0, 0.0]}))
    wrench = completed(model, glide(np.zeros(20), np.full(20, 1e-5))).runs[0].wrench
    assert wrench[0, 2] == pytest.approx(-9.81e-2) and wrench[0, 4] == pytest.approx(0.2 * 9.81e-2)


def test_a_plane_model_moves_in_its_plane_as_the_whole_one_does():
    whole = GreyBox(plain_vehicle(**DRAG, center_of_gravity=[0.02, 0.0, 0.05]))
    eta = torch.tensor([0.0, 0.0, 5.0, 0.0, 0.3, 0.7], dtype=torch.float64)
    command = torch.tensor([5.0, 0.0, -3.0, 0.0, 1.0, 0.0], dtype=torch.float64)
    nu = torch.tensor([0.5, 0.0, 0.1, 0.0, 0.2, 0.0], dtype=torch.float64)
    flat = whole.rebuilt(
        [], vehicle=plain_vehicle(**DRAG, center_of_gravity=[0.02, 0.0, 0.05], reduced={"plane": "vertical"})
    )
    torch.testing.assert_close(flat(eta, nu, command), whole(eta, nu, command))
    level = torch.tensor([0.0, 0.0, 5.0, 0.0, 0.0, 0.7], dtype=torch.float64)
    turning = torch.tensor([0.5, 0.1, 0.0, 0.0, 0.0, 0.3], dtype=torch.float64)
    floor = GreyBox(plain_vehicle(**DRAG, reduced={"plane": "horizontal"}))
    sea = GreyBox(plain_vehicle(**DRAG))
    push = torch.tensor([5.0, 2.0, 0.0, 0.0, 0.0, 1.0], dtype=torch.float64)
    torch.testing.assert_close(floor(level, turning, push), sea(level, turning, push))


def test_forces_out_of_the_plane_are_held_by_constraints():
    model = GreyBox(plain_vehicle(**DRAG, reduced={"plane": "vertical"}))
    push = torch.tensor([1.0, 50.0, 2.0, 20.0, 3.0, 10.0], dtype=torch.float64)
    rate = model(torch.zeros(6, dtype=torch.float64), torch.zeros(6, dtype=torch.float64), push)
    np.testing.assert_allclose(rate.detach()[[1, 3, 5]], 0.0)
    np.testing.assert_allclose(rate.detach()[[0, 2, 4]], [1.0 / 70.0, 2.0 / 90.0, 3.0 / 4.5])


def test_a_prescribed_turn_carries_the_offset_centre_along():
    """With the centre of gravity at x: Z = (m + Z_a) w_dot - m x q_dot, so w_dot = m x q_dot / (m + Z_a)."""
    model = GreyBox(plain_vehicle(**GLIDER, center_of_gravity=[0.1, 0.0, 0.0]))
    turn = torch.tensor([0.0, 0.0, 0.0, 0.0, 0.4, 0.0], dtype=torch.float64)
    rate = model(torch.zeros(6, dtype=torch.float64), torch.zeros(6, dtype=torch.float64), turn).detach()
    assert float(rate[4]) == pytest.approx(0.4)
    assert float(rate[2]) == pytest.approx(50.0 * 0.1 * 0.4 / 90.0)


def test_a_plane_log_counts_its_plane_alone():
    model = GreyBox(plain_vehicle(**DRAG, reduced={"plane": "vertical"}, ballast={}))
    log = completed(model, glide(0.1 * np.sin(0.1 * np.arange(100)), np.full(100, -1e-5)))
    assert {"v", "p", "r", "phi", "psi", "x", "y"} <= set(log.estimated)
    assert "theta" not in log.estimated and "z" not in log.estimated
    assert any("vertical plane" in words for words in assumed(log, model))


def test_what_a_model_file_says_comes_back():
    vehicle = plain_vehicle(**GLIDER, moving_mass={"mass": 9.0, "axis": [1.0, 0.0, 0.0]})
    assert type(vehicle).from_dict(vehicle.to_dict()) == vehicle
    assert "reduced" not in plain_vehicle().to_dict()


THRUSTER = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 1, "max_reverse": 1}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reduced": {"plane": "tilted"}}, "not a plane"),
        ({"reduced": {"attitude": "guessed"}}, "unknown"),
        ({"reduced": {"planes": "vertical"}}, "Did you mean"),
        ({"moving_mass": {"axis": [1, 0, 0]}}, "mass is missing"),
        (
            {"ballast": {}, "thrusters": [THRUSTER]},
            "together with thrusters",
        ),
    ],
)  # fmt: skip
def test_a_wrong_model_file_is_refused(changes, words):
    with pytest.raises(ModelError, match=words):
        plain_vehicle(**changes)


def test_a_log_without_the_ballast_is_refused():
    model = GreyBox(plain_vehicle(**GLIDER))
    log = glide(np.zeros(20), np.zeros(20))
    bare = Log.from_runs([Run(**{**vars(log.runs[0]), "ballast": None})])
    with pytest.raises(InputError, match="no column ballast"):
        completed(model, bare)
