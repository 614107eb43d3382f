"""What names cost in free running, against sums made here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law.rounds import free_running_cost as free_running_cost_module
from auvnn.diagnosis.noise_law.rounds.free_running_cost import Cost, free_running_cost
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

RMS, TIME = np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5]), 1.0


def test_the_cost_is_that_of_errors_and_of_predictions_that_move():
    """Against errors and changes summed here, sample by sample."""
    model = GreyBox(small_vehicle())
    truth = model.with_effects({"net_buoyancy": {"force": 8.0}})
    log = wandering_log(truth, 0.2 * RMS, TIME, runs=2, duration=20.0)
    scale = scale_of(log)

    before, after = (model.with_effects({"net_buoyancy": {"force": force}}) for force in (0.0, 8.0))
    found = free_running_cost(after, before, log, scale)
    cost, size = found.error, found.moves
    predicted = []
    for force in (0.0, 8.0):
        rolled = roll(model.with_effects({"net_buoyancy": {"force": force}}), log, "5", scale)
        assert rolled is not None
        predicted.append(rolled.predicted[:, 1:])
    measured, mask = rolled.windows.nu.numpy()[:, 1:], rolled.windows.mask[:, 1:, 6:12].numpy() > 0

    def size_of(gap):
        rms = np.array([np.sqrt((gap[..., i][mask[..., i]] ** 2).mean()) for i in range(6)]) / scale.std
        return rms[scale.excited].mean()

    errors = [size_of(p - measured) for p in predicted]
    assert cost == pytest.approx(errors[0] / errors[1] - 1.0, rel=1e-6) and cost > 0.1
    away = size_of(predicted[1] - predicted[0]) / errors[1]
    assert size == pytest.approx(np.sqrt(1.0 + away**2) - 1.0, rel=1e-6)
    # The force does not know of the commands here: both figures say much the same.
    assert size == pytest.approx(cost, rel=0.5)
    assert free_running_cost(after, after, log, scale) == Cost(0.0, 0.0, 0.0, 0.0, worse=False)
    # In the median window: of each window's mean square in units of the velocities' variance.
    squares = [
        (((p - measured) ** 2 * mask).sum(1) / mask.sum(1) / scale.std**2)[:, scale.excited]
        for p in predicted
    ]
    middle = [np.sqrt(np.median(s, axis=0)).mean() for s in squares]
    assert found.typical == pytest.approx(middle[0] / middle[1] - 1.0, rel=1e-6) and found.least >= cost
    # The other way round errors are larger in nearly all windows.
    assert not found.worse and free_running_cost(before, after, log, scale).worse


def test_a_window_without_a_sample_of_a_velocity_is_none_of_the_median():
    """Two of three windows have no sample of v: the third is the median one."""
    squared, count = (
        np.array([[4.0, 0.0], [9.0, 0.0], [16.0, 50.0]]),
        np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 2.0]]),
    )
    rolled: Any = SimpleNamespace(squared=squared, count=count)
    scale: Any = SimpleNamespace(std=np.ones(2), excited=np.ones(2, dtype=bool))
    assert free_running_cost_module._median(scale, rolled) == pytest.approx((3.0 + 5.0) / 2.0)
    by_window = free_running_cost_module._by_window(scale, rolled)
    assert free_running_cost_module._surely_less(by_window, by_window + 5.0)
