"""Stochastic gradient descent, the paper's back propagation."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.training.schemes.base import positive
from auvnn.training.schemes.gradient import GradientScheme


class SGD(GradientScheme):
    """Plain gradient descent, by mini-batches if wanted; see `GradientScheme` for the other options.

    Args:
        momentum: share of the last step that is kept, 0 for none.
        options: those of `GradientScheme`.
    """

    name = "sgd"

    def __init__(self, *, momentum: float = 0.9, **options: Any) -> None:
        """Check the options."""
        super().__init__(**options)
        self.momentum = positive(momentum, "momentum", zero=True)

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        return {**super().options(), "momentum": self.momentum}

    def optimiser(self, parameters: list[Tensor]) -> torch.optim.Optimizer:
        """Return torch's SGD."""
        return torch.optim.SGD(parameters, lr=self.learning_rate, momentum=self.momentum)
