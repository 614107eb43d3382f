"""A law of accelerations told as that of the forces behind them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law.hypothesis import in_newtons
from auvnn.metrics.force_law import ForceLaw
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle


def test_a_heavier_vehicle_needs_more_force_for_the_same_acceleration():
    stated = GreyBox(small_vehicle()).prepare()
    law = ForceLaw(np.full(6, 2.0), np.ones(6), 0.5, 2.0, response=stated.inverse.numpy())
    model = GreyBox(small_vehicle()).with_effects({"added_mass": {"X": 1.4}})
    found: Any = SimpleNamespace(fitted=SimpleNamespace(model=model), effects=("added_mass",))
    told = in_newtons(law, found)
    assert told is not None
    more = 0.4 * float(stated.added[0, 0]) * float(stated.inverse[0, 0])
    assert told.rms[0] == pytest.approx(2.0 * (1.0 + more)) and more > 0.1
    assert told.rms[1:] == pytest.approx(2.0, rel=1e-3)
    # Where the law is that of forces already nothing changes.
    plain = ForceLaw(np.full(6, 2.0), np.ones(6), 0.5, 2.0)
    assert in_newtons(plain, found) is plain and in_newtons(None, found) is None
