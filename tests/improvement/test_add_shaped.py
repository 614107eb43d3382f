"""add() of an effect whose null says nothing of when and how: it has to find a place to start from by itself."""

from __future__ import annotations

import pytest

from auvnn.improvement import add
from auvnn.models import load
from auvnn.simulation import simulate


def test_a_load_is_added_at_the_time_at_which_it_was_picked_up():
    model = load("rov95")
    hidden = {"payload": {"time": 8.5, "mass": 3.0, "z": 0.4}}
    made = simulate(model, "multisine", "realistic", hidden, runs=2, duration=14.0, rate=10.0, max_step=0.05)
    better = add(model, made.log, "payload")
    found = better.parameters["payload"]
    assert better.accepted
    assert found["time"]["value"] == pytest.approx(8.5, abs=0.3)
    # What hangs below weighs 3 kg more than it floats; mass and buoyancy apart the log can hardly tell.
    net = 9.81 * found["mass"]["value"] - found["buoyancy"]["value"]
    assert net == pytest.approx(9.81 * 3.0, rel=0.1)
