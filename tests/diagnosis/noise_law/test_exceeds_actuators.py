"""A stochastic force as large as the actuators' leaves no name; one that changes too fast to move the vehicle may."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.noise_law.answer import exceeds_actuators
from auvnn.diagnosis.residuals.forces import actuators_of
from auvnn.metrics.force_law import ForceLaw
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.mark.parametrize(
    ("share", "time", "expected"),
    [(2.0, 1.0, True), (0.2, 1.0, False), (2.0, 0.02, False), (2.0, 30.0, True)],
)
def test_the_mean_over_a_second_is_held_against_the_actuators(share, time, expected):
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    drive = actuators_of(model, windows)
    asked: Any = SimpleNamespace(layout=SimpleNamespace(model=model))
    state: Any = SimpleNamespace(windows=windows)
    rms = np.array([0.0, share * drive[:3].max(), 0.0, 0.0, 0.0, 0.0])
    law = ForceLaw(rms, np.full(6, time), 0.5, 5.0)
    assert exceeds_actuators(asked, state, law) is expected
    assert not exceeds_actuators(asked, state, None)
