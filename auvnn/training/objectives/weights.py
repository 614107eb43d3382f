"""The weights of a model's damping subnetworks as one vector."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.models import GreyBox

Array = NDArray[np.float64]


def get_weights(model: GreyBox) -> Array:
    """Return all weights of the subnetworks, joined, (P,)."""
    assert model.damping is not None
    return np.concatenate([p.detach().cpu().double().numpy().ravel() for p in model.damping.parameters()])


def set_weights(model: GreyBox, values: Array) -> None:
    """Set all weights of the subnetworks from (P,) numbers."""
    assert model.damping is not None
    at = 0
    with torch.no_grad():
        for parameter in model.damping.parameters():
            size = parameter.numel()
            parameter.copy_(_like(values[at : at + size], parameter))
            at += size


def _like(values: Array, parameter: Tensor) -> Tensor:
    return torch.as_tensor(values).to(parameter).view_as(parameter)
