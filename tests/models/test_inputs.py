"""Rows of inputs: slices and single rows keep what belongs together."""

from __future__ import annotations

import torch

from auvnn.models import Inputs


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
