"""Thrust curves that are off by no form of the catalogue: they are named as one polynomial, and nothing else is."""

from __future__ import annotations

import pytest

from auvnn.diagnosis import diagnose
from auvnn.models import load
from auvnn.simulation import simulate

FORMS = ["thruster_gain", "thrust_asymmetry", "thrust_curve", "thrust_polynomial"]
OTHERS = ["thruster_deadband", "constant_force", "cg_offset"]


@pytest.fixture(scope="module")
def log():
    """Each thruster's thrust is T (1 + 0.05 cos(pi c + phase)), its phase drawn."""
    world = {"shape": {"thrust": 0.05}}
    how = {"runs": 2, "duration": 40.0, "rate": 10.0, "seed": 6, "plant": "numpy"}
    return simulate(load("bluerov2"), "multisine", "realistic", world=world, **how).log


def test_curves_off_as_a_wave_are_one_polynomial_and_leave_nothing(log):
    found = diagnose(load("bluerov2"), log, effects=[*FORMS, *OTHERS])
    assert found.missing == ["thrust_polynomial"]
    assert [step["verdict"] for step in found.steps] == ["named", "adequate"]
