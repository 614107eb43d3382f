"""The command that stands for an interval over which the command changes: the one whose thrust is the mean thrust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.models import GreyBox

# Commands of which the thrust is looked up, from -1 to 1.
GRID = 4001


@dataclass(frozen=True)
class MeanThrust:
    """The stated curves of a vehicle's thrusters, and what leads back from a thrust to its command.

    A curve bends: over an interval in which the command rises by d, a quadratic one gives d^2 / 12 of full thrust more
    than at the mean command. The thrust that effects make of commands bends nearly alike.

    An allocation makes commands of thrusts. Those of a smooth wrench are smooth then, and the commands bend at once where
    a thrust goes through zero, so that a curve through the thrusts of the samples is nearer to what went on between them.

    Attributes:
        command: that are looked up, (G,).
        thrust: at these, never falling, N, (G, n).
        through_thrusts: whether lines and cubics go through the thrusts of the samples, not through their commands.
    """

    command: NDArray[np.float64]
    thrust: NDArray[np.float64]
    through_thrusts: bool = False

    def of_thrusts(self) -> MeanThrust:
        """Return the same curves for lines and cubics through the thrusts of the samples."""
        return replace(self, through_thrusts=True)

    @classmethod
    def of(cls, model: GreyBox) -> MeanThrust | None:
        """Return the curves of a model's thrusters; None where a wrench is commanded, which is its own mean."""
        if model.actuation == "wrench":
            return None
        grid = torch.linspace(-1.0, 1.0, GRID, dtype=torch.float64)
        with torch.no_grad():
            thrust = model.actuators.static(grid.unsqueeze(-1).expand(-1, model.actuators.size))
        # Of commands that give the same thrust, behind a curve's peak or in a dead band, one stands for all.
        return cls(grid.numpy(), np.maximum.accumulate(thrust.numpy(), axis=0))

    def command_for(self, paths: Sequence[Tensor], weights: Sequence[float]) -> Tensor:
        """Return the commands (..., n) with the weighted mean of the thrusts of others.

        Args:
            paths: commands (..., n) at several moments of each interval.
            weights: of these, one in sum.
        """
        mean = torch.stack([w * path for path, w in zip(paths, weights, strict=True)]).sum(0)
        found = mean.clone()
        for i in range(mean.shape[-1]):
            curve = self.thrust[:, i]
            parts = [np.interp(path[..., i].numpy(), self.command, curve) for path in paths]
            wanted = sum(w * part for part, w in zip(parts, weights, strict=True))
            # A cubic may go beyond what a thruster has; it gives its most then.
            found[..., i] = torch.from_numpy(np.interp(wanted, curve, self.command))
        still = torch.stack([(path - paths[0]).abs() for path in paths]).amax(0) == 0.0
        return torch.where(still, mean, found)
