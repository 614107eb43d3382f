"""Models that several tests share."""

from __future__ import annotations

import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64


@pytest.fixture(scope="session")
def rov():
    """Return the surrogate under a commanded wrench; not to be changed."""
    return GreyBox(load_vehicle("rov95"), actuation="wrench")


@pytest.fixture(scope="session")
def example():
    """Return a vehicle with full matrices, elements, a thrust table and fins; not to be changed."""
    return GreyBox(example_vehicle())


@pytest.fixture
def bank():
    """Return subnetworks of several forms, away from their start, small beside the drag of a vehicle."""
    made = DampingBank.from_description(
        {"form": "mlp", "each": {"K": "zero", "M": "polynomial", "N": "dissipative"}}
    )
    generator = torch.Generator().manual_seed(4)
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.add_(0.2 * torch.randn(parameter.shape, generator=generator, dtype=DOUBLE))
        made.input_scale.copy_(torch.tensor([0.7, 0.5, 0.4, 0.3, 0.3, 0.6], dtype=DOUBLE))
        made.output_scale.copy_(torch.tensor([3.0, 4.0, 5.0, 0.3, 0.4, 0.5], dtype=DOUBLE))
    return made


@pytest.fixture
def forced():
    """Return start, commands and times of a run in which every velocity is positive and stays so."""
    eta = torch.tensor([0, 0, 5.0, 0.1, -0.05, 0.4], dtype=DOUBLE)
    nu = torch.tensor([0.3, 0.2, 0.1, 0.2, 0.15, 0.25], dtype=DOUBLE)
    wrench = torch.tensor([160.0, 120.0, 90.0, 40.0, 30.0, 20.0], dtype=DOUBLE)
    return eta, nu, wrench
