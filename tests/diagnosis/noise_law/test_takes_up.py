"""A further name that only takes up what earlier ones get wrong is no name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law import under_law
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.search import ForceSearch


@pytest.mark.parametrize(
    ("further", "gained", "predicted", "less", "expected"),
    [
        ("constant_force", 40.0, 0.3, False, True),
        # What the form of an asymmetry gets wrong looks like a constant force, whatever inputs predict.
        ("constant_force", 40.0, 0.05, False, True),
        ("constant_force", 40.0, None, False, True),
        # Known to be confused with one before it, and no more than that.
        ("thruster_gain", 40.0, 0.3, True, True),
        ("thruster_gain", 40.0, 0.05, True, False),
        ("thruster_gain", 40.0, None, True, False),
        # Half as much as the two names before it, each, is more than what they get wrong, if it also exerts more.
        ("constant_force", 49.0, 0.3, False, True),
        ("constant_force", 51.0, 0.3, False, False),
        ("constant_force", 400.0, None, True, True),
        ("constant_force", 400.0, None, False, False),
        # Not known to be confused with what was named before it.
        ("gyro_bias", 40.0, 0.3, True, False),
    ],
)
def test_a_further_name_that_takes_up_what_an_earlier_one_gets_wrong_is_no_name(
    further, gained, predicted, less, expected, monkeypatch
):
    told = None if predicted is None else InputPrediction("X", "u", 0.5, predicted)
    asked: Any = ForceSearch.__new__(ForceSearch)
    asked.in_closed_loop, asked.asked = True, SimpleNamespace(stated={"waves": None})
    monkeypatch.setattr(under_law, "predicted_by_inputs", lambda *_, **__: told)
    compared = []
    monkeypatch.setattr(name_after_name, "exerts_less", lambda *given: compared.append(given[3:]) or less)
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
    # With the one that leaves such a thing, not with what else was named; of the model's effects the change counts.
    assert all(given == (["thrust_asymmetry"], {"waves": None}) for given in compared)
