"""What an answer says of commands between samples: the law that was found, in words."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.noise_law.words import stochastic_words
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle

CURVES: Any = MeanThrust.of(GreyBox(small_vehicle()))


@pytest.mark.parametrize(
    ("held", "said"),
    [
        (
            Holding("ahead", 0.3, 9.0, 18.0),
            "the mean thrust of an interval was taken as 70% of its own sample's and 30%",
        ),
        (
            Holding("smooth", 0.45, 9.0, 18.0, curves=CURVES),
            "the cubic through four samples, -0.05 of an interval",
        ),
        (
            Holding("smooth", 0.475, 9.0, 18.0, curves=CURVES.of_thrusts()),
            "the cubic through the thrusts of four samples, -0.03 of an interval",
        ),
        (
            Holding("averaged", 0.5, 9.0, 18.0, 4),
            "the mean command of an interval was taken as the average of 4 samples",
        ),
    ],
)
def test_the_law_is_said(held, said):
    (line,) = stochastic_words({"commands": held.to_dict()})
    assert said in line


def test_of_held_commands_nothing_is_said():
    assert stochastic_words({"commands": HELD.to_dict()}) == []


def test_an_answer_says_what_was_interpolated_where_it_is_the_thrust():
    assert "interpolated" not in Holding("smooth", 0.4, 9.0, 18.0, curves=CURVES).to_dict()
    assert Holding("smooth", 0.4, 9.0, 18.0, curves=CURVES.of_thrusts()).to_dict()["interpolated"] == "thrust"
    # Commands that change at once have the mean thrust by either.
    command = torch.linspace(-0.9, 0.9, 5, dtype=torch.float64)[:, None].expand(-1, 8)
    one, other = command[:-1], command[1:]
    plain, through = (c.command_for([one, other], (0.3, 0.7)) for c in (CURVES, CURVES.of_thrusts()))
    assert torch.equal(plain, through)
