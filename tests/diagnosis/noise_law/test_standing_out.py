"""Names that are given in spite of what they leave."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law import withheld as module
from auvnn.diagnosis.noise_law.hypothesis import leaves_little, stands_out
from auvnn.diagnosis.noise_law.withheld import withheld
from auvnn.metrics.force_law import ForceLaw


def hypothesis(name: str, evidence: float) -> Any:
    return SimpleNamespace(name=name, evidence=evidence - 1000.0)


@pytest.mark.parametrize(
    ("gain", "others", "expected"),
    [
        (401.0, {"waves": 100.0}, True),
        (399.0, {"waves": 100.0}, False),
        # What is known to be confused with it is no rival: the one may stand for the other.
        (401.0, {"waves": 100.0, "body_lift": 390.0}, True),
        (401.0, {"body_lift": 390.0, "tether": 101.0}, False),
        # Alone, or with others that explain nothing, it must still gain something.
        (101.0, {}, True),
        (99.0, {"waves": -5.0}, False),
    ],
)
def test_a_name_stands_out_that_gains_four_times_what_others_do(gain, others, expected):
    first = hypothesis("munk_moment", gain)
    found = [first, *(hypothesis(n, g) for n, g in others.items())]
    assert stands_out(first, found, hypothesis("", 0.0)) is expected


def law_of(*rms: float) -> ForceLaw:
    return ForceLaw(np.array(rms), np.full(6, 2.0), 0.5, 5.0)


def test_next_to_nothing_is_left_where_a_tenth_of_the_square_is():
    before = law_of(4.0, 0.0, 2.0, 0.0, 1.0, 0.0)
    assert leaves_little(law_of(4.0, 0.0, 2.0, 0.0, 0.31, 0.0), before)
    assert not leaves_little(law_of(4.0, 0.0, 2.0, 0.0, 0.33, 0.0), before)
    # A degree of freedom that had none is not explained; all of it is where nothing is left.
    assert not leaves_little(law_of(4.0, 0.0, 2.0, 0.0, 1.0, 0.0), before) and leaves_little(None, before)


@pytest.mark.parametrize(
    ("refutes", "ahead", "heave", "steps", "expected"),
    [
        (True, False, 2.0, 1, True),
        (True, True, 2.0, 1, False),
        (True, False, 0.6, 1, False),
        # Without any name nothing was explained.
        (True, False, 0.6, 0, True),
        (False, False, 2.0, 1, False),
    ],
)
def test_what_is_left_withholds_names_that_do_not_stand_out(
    monkeypatch, refutes, ahead, heave, steps, expected
):
    monkeypatch.setattr(module, "refuted", lambda *_, **__: refutes)
    result: Any = SimpleNamespace(
        estimate=SimpleNamespace(law=law_of(4.0, 3.0, heave, 0.0, 0.0, 0.0)),
        first_law=law_of(4.0, 3.0, 2.0, 0.0, 0.0, 0.0),
        steps=[{"effects": ["payload"]}] * steps,
        stands_out=ahead,
    )
    nothing: Any = None
    assert withheld(nothing, nothing, result, chance=True) is expected
