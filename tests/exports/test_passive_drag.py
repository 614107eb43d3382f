"""The limit that keeps learned drag from giving energy goes with the model wherever it is written."""

from __future__ import annotations

import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.exports import export
from auvnn.models import GreyBox, load


def test_a_limited_model_is_written_with_its_limit(tmp_path):
    """The export compares what it wrote with the model, and refuses a difference: weights that push show the limit."""
    pytest.importorskip("onnxruntime")
    known, bank = load("rov95", actuation="wrench"), DampingBank.from_description("polynomial", 0)
    with torch.no_grad():
        for parameter in bank.parameters():
            parameter.fill_(-400.0)
    free = GreyBox(known.vehicle, (), bank, "wrench")
    eta = torch.tensor([[0.0, 0, 5, 1, 0, 0, 0]], dtype=torch.float64)
    nu, none = torch.full((1, 6), 0.5).double(), torch.zeros(1, 6).double()
    with torch.no_grad():
        before = free(eta, nu, none)
        bank.passive = True
        limited = GreyBox(known.vehicle, (), bank, "wrench")
        assert not torch.allclose(limited(eta, nu, none), before)
    assert export(limited, "onnx", tmp_path / "onnx").to_dict()["lost"] == []
