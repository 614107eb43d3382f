"""What effects on commands share that depend on how large these are: commands as shares of the full one."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.sizes import full_wrench


class FullCommandEffect(Effect):
    """An effect on commands, of which a full one is 1, and of a wrench the full effort in its degree of freedom."""

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep what a full command is."""
        self.keep("full", full_wrench(vehicle) if actuation == "wrench" else 1.0)

    def share(self, command: Tensor) -> Tensor:
        """Return commands, (..., n), as shares of full ones, with their sign."""
        return command / self.kept("full").to(command)
