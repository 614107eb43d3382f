"""The excitations: what they ask of a vehicle and what it does with it."""

import dataclasses

import numpy as np
import pytest
import torch

from auvnn.catalogue import Catalogue
from auvnn.models import GreyBox
from auvnn.simulation import make_excitation, simulate
from auvnn.simulation.allocation import Allocation
from auvnn.simulation.cruise import cruise
from auvnn.simulation.limits import drag_at
from auvnn.vehicle import builtin_vehicles, load_vehicle

COARSE = {"rate": 10.0, "max_step": 0.05}
# Least standard deviation of each velocity, m/s and rad/s: well above the noise of the realistic condition.
LEAST = np.array([0.06, 0.05, 0.05, 0.05, 0.05, 0.1])
LEAST_CRUISING = np.array([0.1, 0.04, 0.02, 0.02, 0.05, 0.04])


def model_of(name: str, actuation: str | None = None, **changes) -> GreyBox:
    return GreyBox(dataclasses.replace(load_vehicle(name), **changes), actuation=actuation)


def regressors(log) -> float:
    """Condition number of [nu, nu |nu|] with columns of unit length."""
    nu = np.concatenate([r.nu for r in log.runs])
    table = np.concatenate([nu, nu * np.abs(nu)], axis=1)
    return float(np.linalg.cond(table / np.linalg.norm(table, axis=0)))


@pytest.mark.parametrize("name", builtin_vehicles())
def test_multisine_excites_every_degree_of_freedom_within_limits(name):
    log = simulate(model_of(name), "multisine", runs=3, duration=60.0, **COARSE, noise="none").log
    cruising = name == "remus100"
    least = LEAST_CRUISING if cruising else LEAST
    for run in log.runs:
        assert (run.nu.std(axis=0) > least).all(), run.nu.std(axis=0)
        leaning = np.abs(run.euler[:, :2]).max(axis=0)
        assert leaning.max() < np.radians(50 if cruising else 36)
        assert (leaning > np.radians(2 if cruising else 4)).all()
        assert run.position[:, 2].min() > 0.5
        assert np.abs(run.thrusters).max() <= 1.0
        assert np.abs(run.nu[:, :3]).max() < 2.0
    assert regressors(log) < (100 if cruising else 15)
    headings = [r.euler[0, 2] for r in log.runs]
    assert np.ptp(headings) > 0.3
    if cruising:
        assert np.concatenate([r.fins for r in log.runs]).std(axis=0).min() > 0.01
        assert np.abs(np.concatenate([r.fins for r in log.runs])).max() < 0.26


def test_multisine_keeps_to_its_band_and_differs_between_axes_and_runs():
    excitation = {"name": "multisine", "low": 0.1, "high": 0.4}
    log = simulate(model_of("rov95", "wrench"), excitation, runs=2, duration=60.0, **COARSE, noise="none").log
    tau = np.stack([r.wrench for r in log.runs])
    window = np.hanning(tau.shape[1])[None, :, None]
    power = np.abs(np.fft.rfft((tau - tau.mean(axis=1, keepdims=True)) * window, axis=1)) ** 2
    frequency = np.fft.rfftfreq(tau.shape[1], 0.1)
    inside = (frequency > 0.1 - 0.04) & (frequency < 0.4 + 0.04)
    assert (power[:, inside].sum(axis=1) > 0.99 * power.sum(axis=1)).all()
    rows = tau.transpose(0, 2, 1).reshape(12, -1)
    assert np.abs(np.corrcoef(rows) - np.eye(12)).max() < 0.6


def test_multisine_of_a_vehicle_without_stated_damping():
    bare = model_of("rov90", linear_damping=None, quadratic_damping=None)
    run = simulate(bare, "multisine", runs=1, duration=10.0, **COARSE, noise="none").log.runs[0]
    assert (run.nu.std(axis=0) > 0.005).all() and np.abs(run.nu).max() < 5


def test_paper_steady_speeds():
    """F = d v + q v^2 on each axis alone, for the stand-in of the paper's vehicle (its published drag)."""
    drag = drag_at(model_of("rov90"), np.diag([0.29, 0.32, 0.33, 0.23, 0.23, 0.28]))
    assert np.diagonal(drag) == pytest.approx([100.0] * 3 + [10.0] * 3, rel=0.05)
    # Without what couples the axes (unequal added mass, restoring moment) the manoeuvre itself ends there.
    alike = {"added_mass": np.diag([70.0] * 3 + [12.0] * 3), "inertia": 12.0 * np.eye(3)}
    model = model_of("rov90", "wrench", buoyancy=90 * 9.81, center_of_buoyancy=np.zeros(3), **alike)
    options = {"runs": 1, "duration": 15.0, **COARSE}
    pushed = simulate(model, {"name": "paper", "moment": 0.0}, **options, noise="none").log.runs[0].nu[-1]
    turned = simulate(model, {"name": "paper", "force": 0.0}, **options, noise="none").log.runs[0].nu[-1]
    assert pushed[:3] == pytest.approx([0.29, 0.32, 0.33], abs=0.006)
    assert turned[3:] == pytest.approx([0.23, 0.23, 0.28], abs=0.006)


def test_paper_commands_and_their_end():
    model = model_of("rov95", "wrench")
    run = simulate(model, "paper", runs=1, duration=20.0, rate=20.0, max_step=0.05, noise="none").log.runs[0]
    assert np.array_equal(run.wrench[0], [100, 100, 100, 10, 10, 10])
    assert run.t[np.abs(run.wrench).max(axis=1) > 0].max() == pytest.approx(14.95)
    assert (run.nu[0] == 0).all() and run.position[0, 2] == 5.0
    # With the paper's step the flat vehicle turns over its nose: (A33 - A11) u w.
    assert np.abs(run.euler[:, 1]).max() > np.radians(50)


def test_paper_by_thrusters_gives_the_wrench_where_they_reach_it_and_says_where_not():
    options = {"runs": 1, "duration": 1.0, **COARSE}
    reached = simulate(model_of("rov95"), "paper", **options, noise="none")
    allocation = Allocation(load_vehicle("rov95"))
    command = reached.log.runs[0].thrusters[0]
    tau = allocation.matrix @ (120.0 * command * np.abs(command))
    assert tau == pytest.approx([100, 100, 100, 10, 10, 10], abs=0.01)
    assert reached.truth["notes"] == []
    short = simulate(model_of("rov90"), "paper", **options, noise="none").truth["notes"]
    assert len(short) == 1 and "[100 100 100 0 10 10] instead of [100 100 100 10 10 10]" in short[0]


@pytest.mark.parametrize("name", builtin_vehicles())
def test_survey_follows_its_set_points(name):
    made = simulate(model_of(name), "survey", "realistic", runs=3, duration=60.0, **COARSE)
    cruising = name == "remus100"
    for i, run in enumerate(made.log.runs):
        points = {n: made.set_points[n][i] for n in ("heading", "speed", "depth")}
        turn = (run.euler[:, 2] - points["heading"] + np.pi) % (2 * np.pi) - np.pi
        late = {}
        for channel, wanted in points.items():
            steps = np.flatnonzero(np.diff(wanted)) + 1
            assert len(steps) >= (1 if cruising else 3)
            # What counts is the second half of the time that a set point is held for.
            late[channel] = np.concatenate([
                np.arange((a + b) // 2, b) for a, b in zip(steps, [*steps[1:], len(run.t)], strict=True)
            ])  # fmt: skip
        assert np.abs(turn)[late["heading"]].mean() < 0.35
        assert np.abs(run.nu[:, 0] - points["speed"])[late["speed"]].mean() < 0.05
        depth = np.abs(run.position[:, 2] - points["depth"])[late["depth"]].mean()
        assert depth < (0.8 if cruising else 0.25)
        assert np.abs(run.euler[:, :2]).max() < np.radians(45)
        assert np.abs(run.thrusters).max() <= 1.0
    first, second, third = made.set_points["heading"] - made.set_points["heading"][:, :1]
    assert not np.array_equal(first, second) and not np.array_equal(second, third)


def test_survey_holds_against_what_the_model_does_not_know():
    hidden = {"ocean_current": {"v_north": 0.15}, "net_buoyancy": {"force": 10.0}}
    level = {"name": "survey", "climb": 0.0, "hold": [15.0, 25.0]}
    made = simulate(model_of("rov95"), level, "realistic", hidden, runs=2, duration=60.0, **COARSE)
    for i, run in enumerate(made.log.runs):
        settled = slice(300, None)
        assert np.abs(run.position[:, 2] - 5.0)[settled].mean() < 0.1
        assert np.median(np.abs(run.nu[:, 0] - made.set_points["speed"][i])[settled]) < 0.05


def test_survey_acts_on_what_is_measured():
    """A heading that is measured wrong by noise is corrected at once, so noise shows in the commands."""
    options = {"runs": 1, "duration": 3.0, **COARSE}
    model = model_of("rov95")
    quiet, noisy = (simulate(model, "survey", n, **options).log.runs[0] for n in ("none", "realistic"))
    assert not np.array_equal(quiet.thrusters[0], noisy.thrusters[0])
    loud = {"name": "realistic", "standard_deviation": {"r": 0.3}}
    shaken = simulate(model, "survey", loud, **options).log.runs[0]
    assert np.diff(shaken.thrusters, axis=0).std() > 3 * np.diff(noisy.thrusters, axis=0).std()
    # The yaw moment answers the measured rate of the same row, against it.
    allocation = Allocation(load_vehicle("rov95"))
    moment = (120.0 * shaken.thrusters * np.abs(shaken.thrusters)) @ allocation.matrix[5]
    assert np.corrcoef(moment, shaken.nu[:, 5])[0, 1] < -0.9


def test_cruise_is_steady_and_level():
    model = model_of("remus100")
    steady = cruise(model, np.array([0.9]))
    assert 1.2 < steady.nu[0] < 1.6
    eta = torch.tensor([0.0, 0.0, 5.0, 0.0, steady.pitch, 0.0], dtype=torch.float64)
    command = torch.tensor([0.9], dtype=torch.float64)
    with torch.no_grad():
        rate = model(eta, torch.tensor(steady.nu), command, fins=torch.tensor(steady.fins))
    assert rate.numpy() == pytest.approx(np.zeros(6), abs=1e-6)
    climb = steady.nu[2] * np.cos(steady.pitch) - steady.nu[0] * np.sin(steady.pitch)
    assert climb == pytest.approx(0.0, abs=1e-6)


def test_allocation_inverts_curves_and_geometry():
    for name in ("rov95", "bluerov2", "bluerov2_heavy"):
        model = model_of(name)
        allocation = Allocation(model.vehicle)
        assert (allocation.limits[:3] > 0).all()
        for axis in np.flatnonzero(allocation.limits):
            for sign in (1.0, -1.0):
                wanted = np.zeros(6)
                wanted[axis] = 0.5 * sign * allocation.limits[axis]
                command = torch.tensor(allocation.command(allocation.thrust(wanted)))
                given = allocation.matrix @ model.actuators.static(command).numpy()
                assert given[axis] == pytest.approx(wanted[axis], rel=0.05)
    assert Allocation(load_vehicle("rov90")).limits[3] == 0.0
    assert Allocation(load_vehicle("bluerov2")).limits[4] == 0.0
    beyond = Allocation(load_vehicle("bluerov2"))
    assert np.abs(beyond.command(np.full(6, 1e4))) == pytest.approx(np.ones(6))


def test_another_excitation_is_one_class():
    catalogue = Catalogue("excitation", {"still": f"{__name__}:Still"}, "none.such")
    assert make_excitation({"name": "still", "depth": 3}, catalogue).depth == 3.0


@dataclasses.dataclass(frozen=True)
class Still:
    depth: float = 1.0
