"""Effects fitted side by side by several processes: the same answer as one after the other."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.errors import ConfigError
from auvnn.executors.processes import Processes
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

# The package has a function of the same name.
module = importlib.import_module("auvnn.diagnosis.diagnose")
NAMES = ["net_buoyancy", "constant_force", "thruster_gain", "gyro_bias"]
RMS = np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5])


@pytest.fixture(scope="module")
def world() -> tuple[GreyBox, Any]:
    model = GreyBox(small_vehicle())
    plant = model.with_effects({"net_buoyancy": {"force": 3.0}})
    return model, wandering_log(plant, RMS, 1.0, runs=2, duration=40.0, seed=1)


def test_the_answer_of_two_workers_is_that_of_one(world, monkeypatch):
    model, log = world
    asked: list[str] = []

    class Watched(Processes):
        def run(self, function: Any, shared: Any, tasks: Sequence[Any], *, losses: bool = False) -> Any:
            asked.extend([function.__module__.rsplit(".", 1)[-1]] * len(tasks))
            return super().run(function, shared, tasks, losses=losses)

    said: list[str] = []
    alone = diagnose(model, log, NAMES, advice=False, progress=said.append)
    monkeypatch.setattr(module, "executor_for", lambda _, workers, __: Watched(workers))
    told: list[str] = []
    both = diagnose(model, log, NAMES, advice=False, workers=2, progress=told.append)
    assert alone.to_dict() == both.to_dict() and told == said
    # Effects were fitted by the workers both without the force and together with it, more than one at a time.
    assert asked.count("refit_leaders") > 1 and asked.count("leader_fits") > 1
    assert asked.count("one_step_leaders") == len(NAMES)
    assert alone.missing == ["net_buoyancy"]


@pytest.mark.parametrize("workers", [0, -1, True])
def test_fewer_workers_than_one_are_refused(world, workers):
    with pytest.raises(ConfigError, match=f"workers={workers} must be a whole number"):
        diagnose(*world, workers=workers)
