"""Rows 60 to 62: drift, sensors away from the origin, and stretches that are no free motion under water."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from auvnn.logs import Log, Run
from tests.faults.moving_runs import CLEAN, DT, body, found
from tests.log_samples import make_run


def coasting(current: tuple[float, float], decay: float = 1.5, seed: int = 0) -> Run:
    """Pushes and pauses of 15 s: in the pauses the velocity through the water fades away."""
    rng = np.random.default_rng(seed)
    n = 2400
    t = DT * np.arange(n)
    on = (t // 15).astype(int) % 2 == 0
    through = np.zeros((n, 2))
    push = np.array([0.5, 0.3])
    for k in range(1, n):
        through[k] = through[k - 1] + DT / decay * (push * on[k] - through[k - 1])
    base = make_run(n)
    world = np.column_stack([through + np.array(current), 0.1 * np.sin(0.5 * t)])
    nu = np.concatenate([body(base).inv().apply(world), base.nu[:, 3:]], axis=1)
    return make_run(n, nu=nu + 0.003 * rng.normal(size=nu.shape), position=None,
                    thrusters=0.6 * on[:, None] * np.ones((1, 4)))  # fmt: skip


def test_row_60_drift_without_any_command_is_a_current():
    words = found(Log.from_runs([coasting((0.2, -0.1))]), "warning")
    assert (
        "over ground without any command: a current?" in words
        and "consider the effect ocean_current" in words
    )
    assert "about 0.22 m/s" in words
    assert "current" not in found(Log.from_runs([coasting((0.0, 0.0))]), "warning")


def test_row_61_a_velocity_sensor_away_from_the_origin():
    arm = np.array([0.4, -0.1, 0.15])
    nu = np.array(CLEAN.nu)
    nu[:, :3] += np.cross(nu[:, 3:], arm)
    run = Run(1, CLEAN.t, CLEAN.quaternion, nu, position=CLEAN.position, thrusters=CLEAN.thrusters)
    from auvnn.logs.quality.lever import check_lever_arms

    (place,) = check_lever_arms(Log.from_runs([run]))
    assert place.clear and (np.abs(place.place - arm) < np.maximum(2 * place.half, 0.02)).all()
    assert (place.half < 0.05).all()
    words = found(Log.from_runs([run]), "warning")
    assert "lever arm: the velocity sensor seems to sit away from the body origin: x +0.4" in words
    assert "velocity_lever_arm" in words
    (place,) = check_lever_arms(Log.from_runs([CLEAN]))
    assert not place.clear


def test_row_61_an_accelerometer_away_from_the_origin():
    arm = np.array([0.3, 0.2, -0.1])
    rates = CLEAN.nu[:, 3:]
    faster = np.gradient(rates, DT, axis=0)
    smooth = gaussian_filter1d(np.array(CLEAN.nu), 2.0, axis=0)
    slope = np.gradient(smooth, DT, axis=0)
    slope[:, :3] += np.cross(faster, arm) + np.cross(rates, np.cross(rates, arm))
    run = Run(1, CLEAN.t, CLEAN.quaternion, smooth, slope, thrusters=CLEAN.thrusters)
    from auvnn.logs.quality.lever import check_lever_arms

    (place,) = check_lever_arms(Log.from_runs([run]))
    assert place.sensor == "acceleration" and place.clear and np.abs(place.place - arm).max() < 0.06
    assert "info: lever arm: the vehicle turns, and without a position nobody can tell" in found(
        Log.from_runs([run])
    )


def stretch(kind: str) -> Run:
    """The clean run with something else than free motion from 30 to 45 s."""
    rows = slice(600, 900)
    nu, position = np.array(CLEAN.nu), np.array(CLEAN.position)
    thrusters, altitude = np.array(CLEAN.thrusters), np.full(1600, 3.0)
    rng = np.random.default_rng(2)
    if kind == "surface":
        position[rows, 2] = 0.02 * np.sin(np.arange(300))
    elif kind == "air":
        position[rows, 2] = -0.8
    elif kind in ("held", "bottom"):
        nu[rows] = 0.003 * rng.normal(size=(300, 6))
        thrusters[rows] = 0.7
        altitude[rows] = 0.05 if kind == "bottom" else 3.0
    elif kind == "moved":
        thrusters[rows] = 0.0
        nu[rows, :3] = np.column_stack([np.linspace(0, 0.9, 300), np.zeros((300, 2))])
    return Run(1, CLEAN.t, CLEAN.quaternion, nu, position=position, thrusters=thrusters, altitude=altitude)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("surface", "at the surface, where added mass"),
        ("air", "above the surface, in the air"),
        ("bottom", "on the bottom: driven, but standing still close above it"),
        ("held", "driven, but standing still: on the bottom, held by hand, or its tether is tight?"),
        ("moved", "set in motion without any command: by hand"),
    ],
)
def test_row_62_stretches_that_are_no_free_motion(kind, words):
    from auvnn.logs.quality.situations import find

    log = Log.from_runs([stretch(kind)])
    (finding,) = [f for f in log.quality().warnings if f.where == "situation"]
    assert words in finding.what
    (part,) = [s for s in find(log) if s.kind == kind]
    assert part.start == pytest.approx(30.0, abs=0.5) and part.stop == pytest.approx(45.0, abs=0.5)
