"""Vehicles simple enough that the answer can be written down by hand."""

from __future__ import annotations

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.vehicle import Vehicle

DOUBLE = torch.float64

PLAIN = {
    "name": "plain", "frame": "FRD", "gravity": 9.81, "water_density": 1000.0, "mass": 50.0, "buoyancy": 490.5,
    "length": 1.0, "center_of_gravity": [0.0, 0.0, 0.0], "center_of_buoyancy": [0.0, 0.0, 0.0],
    "inertia": [[2.0, 0, 0], [0, 3.0, 0], [0, 0, 4.0]], "added_mass": [20.0, 30.0, 40.0, 1.0, 1.5, 2.5],
    "uncertainty": {"added_mass": 0.1, "linear_damping": 0.2, "quadratic_damping": 0.2, "inertia": 0.05},
}  # fmt: skip


def plain_vehicle(**changes) -> Vehicle:
    """Return a neutrally buoyant vehicle with diagonal matrices, without damping unless it is given."""
    return Vehicle.from_dict({**PLAIN, **changes})


@pytest.fixture
def plain():
    """Return a function from effects to the model of the plain vehicle under a commanded wrench."""

    def build(effects=None, **changes) -> GreyBox:
        return GreyBox(plain_vehicle(**changes), actuation="wrench").with_effects(effects or {})

    return build


@pytest.fixture
def level():
    """Return a level pose at the origin, heading north."""
    return torch.zeros(6, dtype=DOUBLE)


@pytest.fixture
def still():
    """Return zero velocity, which is also a zero wrench."""
    return torch.zeros(6, dtype=DOUBLE)


@pytest.fixture
def vector():
    """Return a function from numbers to a double-precision tensor."""
    return lambda *numbers: torch.tensor(numbers, dtype=DOUBLE)
