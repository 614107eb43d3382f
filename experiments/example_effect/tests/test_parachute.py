"""The checks that auvnn ships for effects, and a closed form of one's own."""

from __future__ import annotations

import pytest
import torch
from auvnn_example_effect.parachute import Parachute

from auvnn.models import GreyBox
from auvnn.testing import EFFECT_CHECKS, plain_vehicle


@pytest.mark.parametrize("check", EFFECT_CHECKS)
def test_it_keeps_the_contract_of_effects(check):
    EFFECT_CHECKS[check](Parachute)


def test_a_free_mass_slows_down_as_one_over_time():
    """m u' = -d u^2 gives u = u_0 / (1 + d u_0 t / m), m = 50 + 20 kg with added mass."""
    effect = Parachute.build(plain_vehicle(), "wrench", {"drag": 35.0})
    model = GreyBox(plain_vehicle(), [effect], actuation="wrench")
    times = torch.linspace(0, 5, 51, dtype=torch.float64)
    start = torch.tensor([0.8, 0, 0, 0, 0, 0], dtype=torch.float64)
    run = model.rollout(torch.zeros(6).double(), start, torch.zeros(51, 6).double(), times)
    torch.testing.assert_close(run.nu[:, 0], 0.8 / (1 + 35 * 0.8 * times / 70), rtol=1e-6, atol=0)
