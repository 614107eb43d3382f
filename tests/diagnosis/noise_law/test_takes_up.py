"""A further name that only takes up what earlier ones get wrong is no name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import under_law
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.search import ForceSearch


@pytest.mark.parametrize(
    ("further", "gained", "predicted", "expected"),
    [
        ("constant_force", 40.0, 0.3, True),
        # What the form of an asymmetry gets wrong looks like a constant force, whatever inputs predict.
        ("constant_force", 40.0, 0.05, True),
        ("constant_force", 40.0, None, True),
        # Known to be confused with one before it, and no more than that.
        ("thruster_gain", 40.0, 0.3, True),
        ("thruster_gain", 40.0, 0.05, False),
        ("thruster_gain", 40.0, None, False),
        # Half as much as the two names before it, each, is more than what they get wrong.
        ("constant_force", 49.0, 0.3, True),
        ("constant_force", 51.0, 0.3, False),
        # Not known to be confused with what was named before it.
        ("gyro_bias", 40.0, 0.3, False),
    ],
)
def test_a_further_name_that_takes_up_what_an_earlier_one_gets_wrong_is_no_name(
    further, gained, predicted, expected, monkeypatch
):
    told = None if predicted is None else InputPrediction("X", "u", 0.5, predicted)
    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.in_closed_loop = True
    monkeypatch.setattr(under_law, "predicted_by_inputs", lambda *_, **__: told)
    monkeypatch.setattr(asked, "say", lambda _: None, raising=False)
    monkeypatch.setattr(asked, "about", lambda _: None)
    monkeypatch.setattr(asked, "_sums", lambda _: None)
    found = SimpleNamespace(
        estimate=SimpleNamespace(law=object()),
        weighed=None,
        name=further,
        explanation=None,
        evidence=700.0 + gained,
    )
    path: Any = SimpleNamespace(
        chosen=["payload", "thrust_asymmetry"], current=SimpleNamespace(evidence=700.0)
    )
    null: Any = SimpleNamespace(evidence=500.0)
    assert asked._takes_up(found, path, null) is expected
