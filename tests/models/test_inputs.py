"""Rows of inputs: slices and single rows keep what belongs together."""

from __future__ import annotations

from dataclasses import fields

import pytest
import torch

from auvnn.models import Inputs
from auvnn.models.inputs import joined

# Of each input what is beside the windows.
SHAPES = {
    "command": (5, 3), "fins": (5, 4), "voltage": (5,), "altitude": (5,), "within": (5, 2, 3), "fins_within": (5, 2, 4),
}  # fmt: skip


def test_rows_and_single_rows_agree():
    command, fins = torch.randn(2, 5, 3), torch.randn(2, 5, 4)
    inputs = Inputs(command, fins, voltage=torch.randn(2, 5))
    part = inputs.rows(1, 4)
    assert torch.equal(part.command, command[:, 1:4]) and torch.equal(part.fins, fins[:, 1:4])
    assert part.voltage.shape == (2, 3) and part.altitude is None
    rows = inputs.each()
    assert len(rows) == 5
    for k, row in enumerate(rows):
        assert torch.equal(row.command, command[:, k]) and torch.equal(row.fins, fins[:, k])
        assert torch.equal(row.voltage, inputs.voltage[:, k]) and row.altitude is None


def test_rows_without_an_end_go_to_the_last():
    assert Inputs(torch.zeros(5, 3)).rows(2).command.shape == (3, 3)


@pytest.mark.parametrize("missing", [(), ("fins", "fins_within"), ("voltage", "altitude", "within")])
def test_no_input_is_lost_where_windows_are_picked_and_joined(missing):
    assert {*SHAPES} == {f.name for f in fields(Inputs)}
    inputs = Inputs(**{n: None if n in missing else torch.randn(6, *of) for n, of in SHAPES.items()})
    parts = [inputs.mapped(lambda x, at=at: x[at]) for at in (slice(0, 2), slice(2, 6))]
    again = joined(parts)
    for name in SHAPES:
        one, other = getattr(inputs, name), getattr(again, name)
        assert (one is None) is (name in missing) and (other is None) is (one is None)
        assert one is None or torch.equal(one, other)
        assert one is None or getattr(parts[1], name).shape == (4, *SHAPES[name])
