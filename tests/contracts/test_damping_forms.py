"""Every damping form of the catalogue keeps the contract; a new one is tested by being there."""

from __future__ import annotations

import pytest

from auvnn.damping import DAMPING
from auvnn.testing import DAMPING_CHECKS


@pytest.mark.parametrize("check", DAMPING_CHECKS)
@pytest.mark.parametrize("name", DAMPING.names())
def test_the_contract(name, check):
    DAMPING_CHECKS[check](DAMPING.get(name))
