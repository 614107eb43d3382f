"""Vehicles simple enough that the answer can be written down by hand."""

from __future__ import annotations

import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

DOUBLE = torch.float64


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
