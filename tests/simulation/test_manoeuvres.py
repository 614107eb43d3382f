"""The manoeuvres that tell causes apart: each does what its name says, within the vehicle's limits."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.simulation import simulate
from auvnn.simulation.excitations import EXCITATIONS
from auvnn.simulation.manoeuvres import LIBRARY, manoeuvres
from auvnn.vehicle import load_vehicle

OPEN = ("coast_down", "pulses", "oblique", "chirp", "rotation")


@pytest.fixture(scope="module")
def model():
    return GreyBox(load_vehicle("rov95"))


@pytest.fixture(scope="module")
def plans(model):
    return {p.name: p for p in manoeuvres(model, 40.0, 10.0)}


def wrench_of(model, plan):
    """The thrusters' wrench as the actuators see it, (T, 6)."""
    return model.actuators.static(torch.tensor(plan.command)).numpy() @ _matrix(model).T


def _matrix(model):
    units = model.vehicle.thrusters
    d = np.array([u.direction for u in units])
    return np.concatenate([d, np.cross([u.position for u in units], d)], axis=1).T


def test_the_library_is_in_the_catalogue_and_the_vehicle_can_do_all_of_it(plans, model):
    assert set(LIBRARY) <= set(EXCITATIONS.names()) and set(plans) == set(LIBRARY)
    for plan in plans.values():
        assert np.abs(plan.command).max() <= 1.0 + 1e-12 and np.isfinite(plan.command).all(), plan.name
        assert plan.command.shape == (401, len(model.vehicle.thrusters))


@pytest.mark.parametrize("name", OPEN)
def test_it_stays_upright_and_under_water(name, model):
    log = simulate(model, name, runs=2, duration=40.0, rate=10.0, max_step=0.05, noise="none").log
    for run in log.runs:
        assert np.abs(run.euler[:, :2]).max() < 0.75
        assert run.position[:, 2].min() > 0.5
        # Well above the noise of the realistic condition, 6 mm/s and 3 mrad/s.
        assert run.nu.std(axis=0)[3 if name == "rotation" else 0] > 0.03, run.nu.std(axis=0)


def test_while_it_coasts_nothing_is_commanded(plans, model):
    tau = wrench_of(model, plans["coast_down"])
    rest = tau - np.median(tau[60:119], axis=0)
    # Six seconds of push and six of coasting; the trim that carries what weight and buoyancy leave goes on.
    cycle = np.arange(len(tau)) % 120
    assert np.abs(rest[cycle >= 60]).max() < 1e-9
    pushed = np.abs(rest[cycle < 60]).max(axis=0)
    assert (pushed[[0, 1, 2]] > 5).sum() >= 2


def test_pulses_push_as_much_back_as_forth(plans, model):
    tau = wrench_of(model, plans["pulses"])
    cycle = np.arange(len(tau)) // 30
    for k in range(12):
        part = tau[cycle == k]
        peak = np.abs(part).max()
        assert peak > 0.5 and np.abs(part.sum(axis=0)).max() < 0.15 * np.abs(part).sum()


def test_pure_rotation_has_no_force_and_oblique_tow_no_moment(plans, model):
    turning, towing = wrench_of(model, plans["rotation"]), wrench_of(model, plans["oblique"])
    assert np.abs(turning[:, :3]).max() < 0.02 * np.abs(turning[:, 3:]).max() + 1e-6
    assert np.abs(towing[:, 5]).max() < 0.02 * np.abs(towing[:, :3]).max()
    ways = towing[::75, :3] / np.linalg.norm(towing[::75, :3], axis=1, keepdims=True)
    assert (np.abs(ways[:-1] @ ways[1:].T).diagonal() < 0.999).all()


def test_the_chirp_rises_from_its_lowest_to_its_highest_frequency():
    member = EXCITATIONS.get("chirp")(step=0.0, sweep=8.0, low=0.2, high=2.0)
    t = np.arange(0, 8, 0.001)
    unit = member.drawn(8.0, np.random.default_rng(0))(t)
    signal = unit[:, np.abs(unit).sum(axis=0).argmax()]
    crossings = np.flatnonzero(np.diff(np.sign(signal))) * 0.001
    # Between two zero crossings lies half a period.
    half = np.diff(crossings)
    assert 0.5 / half[0] == pytest.approx(0.2 * 10 ** (np.mean(crossings[:2]) / 8), rel=0.1)
    assert 0.5 / half[-1] == pytest.approx(2.0, rel=0.1)


def test_reciprocal_headings_are_opposite_and_the_speed_is_the_same(model):
    log = simulate(model, "reciprocal", runs=1, duration=60.0, rate=10.0, max_step=0.05, noise="none").log
    run = log.runs[0]
    heading = np.unwrap(run.euler[:, 2])
    late = [slice(120, 148), slice(270, 298), slice(420, 448), slice(570, 598)]
    legs = np.array([heading[p].mean() for p in late])
    turns = np.degrees((legs - legs[0]) % (2 * np.pi))
    assert turns == pytest.approx([0, 180, 90, 270], abs=12)
    speeds = [run.nu[p, 0].mean() for p in late]
    assert np.ptp(speeds) < 0.15 * np.mean(speeds) and np.mean(speeds) > 0.05


def test_dives_reach_their_depths(model):
    run = simulate(model, "dives", runs=1, duration=60.0, rate=10.0, max_step=0.05, noise="none").log.runs[0]
    assert np.ptp(run.position[:, 2]) == pytest.approx(4.0, abs=1.2)


def test_what_must_keep_moving_gets_only_what_it_can_do():
    model = GreyBox(load_vehicle("remus100"))
    with pytest.raises(
        ConfigError, match=r"coast_down needs a vehicle that can hover; for remus100 take survey"
    ):
        simulate(model, "coast_down", runs=1, duration=10.0, rate=10.0, noise="none")
    names = {p.name for p in manoeuvres(model, 20.0, 10.0, names=("coast_down", "reciprocal"))}
    assert names == {"reciprocal"}


@pytest.mark.parametrize(("name", "options"), [("coast_down", {"push": 0.0}), ("pulses", {"rest": -1.0}),
    ("oblique", {"hold": 0.0}), ("chirp", {"low": 3.0}), ("chirp", {"sweep": 0.0}), ("rotation", {"high": 0.01}),
    ("reciprocal", {"leg": 0.0}), ("reciprocal", {"speed": 2.0}), ("dives", {"step": 0.0}), ("dives", {"hold": 0.0}),
    ("pulses", {"effort": 0.0}), ("pulses", {"tilt": 2.0})])  # fmt: skip
def test_options_out_of_range_are_refused(name, options):
    with pytest.raises(ConfigError, match=rf"excitation.*{next(iter(options))}"):
        EXCITATIONS.get(name)(**options)
