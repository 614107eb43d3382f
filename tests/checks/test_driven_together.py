"""Eight thrusters driven by six commands: a reversed, a dead and a stuck one are found, and none in sound logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from auvnn.checks import check_actuators
from auvnn.checks.doubts import doubts
from auvnn.logs import Log
from auvnn.models import GreyBox, from_vehicle
from auvnn.simulation.allocation import Allocation
from tests.small_logs import SIZES, make_log, sines, small_vehicle

VEHICLE = small_vehicle()
TRUTH = from_vehicle(VEHICLE)


def commands(seed: int, duration: float = 40.0, rate: float = 10.0) -> np.ndarray:
    """Six sums of sines through the pseudo-inverse of the allocation and of the curves: (N, 8)."""
    t = np.arange(round(duration * rate) + 1) / rate
    thrust = np.clip(SIZES * sines(t, 6, seed) @ Allocation(VEHICLE).inverse.T, -36.0, 36.0)
    return np.sign(thrust) * np.sqrt(np.abs(thrust) / 40.0)


def log_of(seed: int, spoil=lambda told: told, runs: int = 2, drive=commands, truth=TRUTH) -> Log:
    """A log of what was told to the thrusters while they did something else."""
    told = np.stack([drive(100 * seed + number, 40.0) for number in range(runs)])
    made = make_log(truth, runs=runs, duration=40.0, noise=1.0, seed=seed, command=spoil(told))
    return Log.from_runs(
        [replace(r, thrusters=c) for r, c in zip(made.runs, told, strict=True)], name="together"
    )


def reversed_one(i: int):
    return lambda told: told * np.where(np.arange(8) == i, -1.0, 1.0)


def held_at(i: int, value: float):
    return lambda told: np.where(np.arange(8) == i, value, told)


def guessed(seed: int) -> GreyBox:
    """The model as a user has it: drag and added mass wrong by a quarter."""
    random, plain = np.random.default_rng(seed), VEHICLE.to_dict()
    added = np.diag(plain["added_mass"]) if np.ndim(plain["added_mass"]) == 2 else plain["added_mass"]
    known = {"added_mass": added} | {k: plain[k] for k in ("linear_damping", "quadratic_damping")}
    factors = {k: np.clip(1 + 0.25 * random.standard_normal(6), 0.4, 2.0) for k in known}
    return from_vehicle(small_vehicle(**{k: (np.array(v) * factors[k]).tolist() for k, v in known.items()}))


@pytest.mark.parametrize("at", [2, 5])
def test_a_reversed_thruster_is_found_and_the_cure_told(at):
    found = check_actuators(guessed(at), log_of(at, reversed_one(at)))
    assert found.findings == [f"thruster_{at + 1} is reversed"] and found.sure
    assert found.assignment.sign[at] == -1 and np.prod(found.assignment.sign) == -1
    assert len(found.words) == 1 and "scale: -1" in found.words[0]


@pytest.mark.parametrize(("at", "value"), [(1, 0.0), (6, 0.0), (3, 0.4)], ids=["dead", "dead too", "stuck"])
def test_a_dead_or_stuck_thruster_is_found_and_the_cure_told(at, value):
    found = check_actuators(guessed(at), log_of(10 + at, held_at(at, value)))
    assert (
        len(found.findings) == 1 and found.findings[0].startswith(f"thruster_{at + 1} gives ") and found.sure
    )
    assert found.gains[at] < 0.15 and np.delete(found.gains, at).min() > 0.6
    assert "value: 0" in found.words[0]


def test_a_dead_thruster_among_independent_ones_is_found():
    def alone(seed: int, duration: float) -> np.ndarray:
        return np.clip(0.45 * sines(np.arange(round(duration * 10.0) + 1) / 10.0, 8, seed), -0.95, 0.95)

    found = check_actuators(TRUTH, log_of(3, held_at(4, 0.0), drive=alone))
    assert found.sure and [f.split()[0] for f in found.findings] == ["thruster_5"]


def test_compare_and_check_say_it_in_the_same_words():
    log = log_of(7, reversed_one(0))
    said = [w for w in doubts(guessed(7), log) if w.startswith("actuators")]
    told = [f.what for f in log.quality().with_actuators(check_actuators(guessed(7), log)).warnings]
    assert len(said) == 1 and "thruster_1 is reversed" in said[0]
    assert said[0].removeprefix("actuators: ") in told


def test_an_axis_turned_round_is_said_of_the_axis():
    """Horizontal thrusters in the plane of the origin, aft instead of forward, mirrored so that they yaw as before."""
    level, turned = [], []
    for u in VEHICLE.to_dict()["thrusters"]:
        (x, y, _), (a, b, c) = u["position"], u["direction"]
        level.append({**u, "position": [x, y, 0.0]})
        turned.append(
            {**u, "position": [x, -y, 0.0], "direction": [-a, b, c]} if a else {**u, "position": [x, y, 0.0]}
        )
    log = log_of(8, truth=from_vehicle(small_vehicle(thrusters=level)))
    found = check_actuators(from_vehicle(small_vehicle(thrusters=turned)), log)
    assert found.findings == ["all that drives X is turned round"] and found.sure
    assert "correct the directions" in found.words[0]


def test_nothing_is_found_in_twenty_sound_logs():
    for run in log_of(30, runs=20).runs:
        found = check_actuators(guessed(run.number), Log.from_runs([replace(run, number=0)], name="sound"))
        assert found.as_stated and found.words == [], (run.number, found.story)
        assert found.untold == [] and found.confidence > 0.95
        assert set(found.axes) <= set("XYZKMN") and min(found.axes.values()) > 0.5


def test_what_free_running_does_not_bear_out_is_not_said(monkeypatch):
    """The regression is as sure as above, but a model with the change predicts no better."""
    monkeypatch.setattr("auvnn.checks.actuators.predicts_better", lambda *_: False)
    found = check_actuators(guessed(2), log_of(2, reversed_one(2)))
    assert found.withdrawn == ["thruster_3 is reversed"] and not found.findings and found.words == []
    told = found.to_dict()
    assert (
        told["confidence"] == 0.0
        and set(told["sign"].values()) == {1}
        and told["withdrawn"] == found.withdrawn
    )
    assert "nothing is said of the actuators" in found.story[0]
