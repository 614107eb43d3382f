"""Adam: adaptive moments, the usual optimiser of neural networks."""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.training.schemes.gradient import GradientScheme


class Adam(GradientScheme):
    """Kingma and Ba's optimiser with torch's default moments; see `GradientScheme` for the options.

    On these small networks it stays at errors of a few 1e-3, which `levenberg_marquardt` passes in a second.
    """

    name = "adam"

    def optimiser(self, parameters: list[Tensor]) -> torch.optim.Optimizer:
        """Return torch's Adam."""
        return torch.optim.Adam(parameters, lr=self.learning_rate)
