"""A stochastic force as large as the actuators' leaves no name; one that changes too fast to move the vehicle may."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.noise_law import left_force
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.left_force import (
    beyond_actuators,
    exceeds_actuators,
    negligible,
    sized_by_law,
)
from auvnn.diagnosis.noise_law.withheld import goes_further, refuted
from auvnn.diagnosis.residuals.forces import actuators_of
from auvnn.diagnosis.residuals.unnamed_size import Size
from auvnn.diagnosis.residuals.variance_component_test import Unnamed
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
    # Names that have explained three quarters of it are not withheld for that; names that leave more are.
    assert refuted(asked, state, law, 0.3, chance=True) is expected
    assert not refuted(asked, state, law, 0.2, chance=True)
    # What measured inputs predict withholds names that leave more than half, however small it is.
    assert refuted(asked, state, None, 0.6, chance=False) and not refuted(
        asked, state, None, 0.4, chance=False
    )
    assert not refuted(asked, state, None, 0.6, chance=True)


def test_a_vehicle_without_actuators_has_no_force_beyond_theirs(monkeypatch):
    monkeypatch.setattr(left_force, "actuators_of", lambda *_: np.zeros(6))
    asked: Any = SimpleNamespace(layout=SimpleNamespace(model=None))
    state: Any = SimpleNamespace(windows=None)
    law = ForceLaw(np.full(6, 2.0), np.full(6, 1.0), 0.5, 5.0)
    assert not exceeds_actuators(asked, state, law)
    monkeypatch.setattr(left_force, "actuators_of", lambda *_: np.eye(6)[1])
    # One drives sway alone: of forces that is the measure, and of moments there is none.
    assert beyond_actuators(asked, state, law).tolist() == [True, True, True, False, False, False]


@pytest.mark.parametrize(
    ("share", "uncertain", "tolerance", "expected"),
    [
        (0.005, 0.0, Tolerance(), True),
        (0.05, 0.0, Tolerance(), False),
        # Within twice what commands between samples leave uncertain, upper limit included; and beyond it.
        (0.05, 0.04, Tolerance(), True),
        (0.05, 0.02, Tolerance(), False),
        (0.05, 0.04, Tolerance(cost=0.0, force=0.0), False),
    ],
)
def test_what_commands_leave_uncertain_is_no_reason_against_adequate(share, uncertain, tolerance, expected):
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    drive = actuators_of(model, windows)
    asked: Any = SimpleNamespace(layout=SimpleNamespace(model=model), tolerance=tolerance)
    state: Any = SimpleNamespace(windows=windows)
    law = ForceLaw(np.array([0.0, 0.0, 0.0, share * drive[3], 0.0, 0.0]), np.full(6, 0.4), 0.2, 5.0)
    unknown = np.array([0.0, 0.0, 0.0, uncertain * drive[3], 0.0, 0.0])
    assert negligible(asked, state, law, UncertainWrench(unknown, np.zeros(6), 0.1)) is expected
    # White over 0.1 s, a force of 0.4 s has the same power at low frequencies at sqrt(1 / 8) of its rms.
    white = UncertainWrench(np.zeros(6), unknown * np.sqrt(8.0), 0.1)
    assert negligible(asked, state, law, white) is expected


@pytest.mark.parametrize(
    ("share", "time", "expected"),
    [
        # 2 % of the actuators' are tolerated. White over 0.02 s, a force keeps a fifth of its rms over a second.
        (0.05, 0.02, True),
        (0.05, 0.4, False),
        (0.2, 0.02, False),
        (0.015, 5.0, True),
    ],
)
def test_what_changes_from_sample_to_sample_matters_by_its_mean_over_a_second(share, time, expected):
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    # The log is so short that limits of slow forces are wide: ten hours of the same.
    windows = windows.pick(np.tile(np.arange(len(windows)), 2000))
    drive = actuators_of(model, windows)
    asked: Any = SimpleNamespace(layout=SimpleNamespace(model=model), tolerance=Tolerance())
    state: Any = SimpleNamespace(windows=windows)
    law = ForceLaw(np.array([0.0, 0.0, share * drive[2], 0.0, 0.0, 0.0]), np.full(6, time), 0.2, 5.0)
    none = UncertainWrench(np.zeros(6), np.zeros(6), 0.1)
    assert negligible(asked, state, law, none) is expected


@pytest.mark.parametrize(
    ("names", "left", "before", "expected"),
    [
        (["a", "b"], 0.4, ["a"], True),
        (["a", "b"], 0.6, ["a"], False),
        (["b", "a"], 0.4, ["a"], False),
        (["a", "b"], 0.4, [], False),
        # Beside a further name a rival of the first one has lost, or one has come.
        (["a", "b"], 0.4, ["a or c"], True),
        (["a or c", "b"], 0.4, ["a"], False),
        (["a"], 0.4, ["a", "b"], False),
    ],
)
def test_further_names_after_the_same_ones_stand_where_they_leave_less_than_half(
    names, left, before, expected
):
    def found(effects, share):
        known = np.full(6, 2.0)
        # Slow before, fast after: of what changes within a second, a fifth of the mean square counts.
        after = ForceLaw(known * np.sqrt(5.0 * share), np.full(6, 0.1), 0.5, 5.0)
        return SimpleNamespace(
            steps=[{"effects": n.split(" or ")} for n in effects],
            compared=after,
            first_law=ForceLaw(known, np.full(6, 4.0), 0.5, 5.0),
        )

    again: Any = found(names, left)
    assert goes_further(again, found(before, 0.55)) is expected
    assert not goes_further(again, found(before, 0.45))


def test_what_is_left_has_the_size_of_its_law():
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    law = ForceLaw(np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]), np.full(6, 0.4), 0.2, 5.0)
    rough = {axis: Size(9.0, 12.0, 0.5, 2.0) for axis in "XYZKMN"}
    left = Unnamed(np.zeros(6), np.ones(6), np.zeros(6), {"X": 3.0}, rough)
    found = sized_by_law(left, law, windows)
    assert found is not None and found.acts_in == left.acts_in
    times = windows.times[:, windows.warmup :]
    independent = float((times[:, -1] - times[:, 0]).sum()) / 0.8
    upper = 3.0 * (1.0 + 1.645 / np.sqrt(2.0 * independent))
    surge = found.sizes["X"]
    assert (surge.rms, surge.correlation_time, surge.detectable) == (3.0, 0.4, 0.5)
    assert surge.upper == pytest.approx(upper)
    # Elsewhere the law has none; what the log would have shown, and the rough limit, stay.
    assert all(found.sizes[axis] == Size(0.0, 12.0, 0.5, None) for axis in "YZKMN")
    assert sized_by_law(left, None, windows) is left and sized_by_law(None, law, windows) is None
