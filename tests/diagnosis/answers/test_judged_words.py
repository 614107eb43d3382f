"""What is said of the force that is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.answers.judged_words import left


@pytest.mark.parametrize(
    ("cost", "words"),
    [
        (0.25, "; the error of free running is 25% larger compared with the noise floor."),
        (1.5, "; the error of free running is 2.5 times as large compared with the noise floor."),
        # What was taken for the floor is above what the model reaches: nothing is smaller than noise.
        (-0.67, "; the error of free running is not above the noise floor."),
        (None, " rms."),
        (float("nan"), " rms."),
    ],
)
def test_the_error_beside_a_force_is_held_against_the_noise_floor(cost, words):
    axis = {"rms": 0.14, "detectable": 0.1}
    asked: Any = SimpleNamespace(
        left={"Z": axis, "cost": cost}, acts_in={"Z": 0.9}, small_remainder=False, verdict="unknown",
        steps=[{"verdict": "unknown", "effects": [], "p_value": 0.0}],
    )  # fmt: skip
    told = left(asked)
    assert len(told) == 1 and told[0].startswith("What is left amounts to a force of 0.14 N in heave")
    assert told[0].endswith(words)
