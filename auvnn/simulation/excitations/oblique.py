"""Oblique tow by its own thrusters: steady motion at many angles of drift and of attack."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.simulation.excitations.base import Array, require
from auvnn.simulation.excitations.sequence import Manoeuvre


@dataclass(frozen=True)
class Oblique(Manoeuvre):
    """Constant force in one direction after another, any direction of the body's sphere, without a turn.

    Attributes:
        hold: how long each direction lasts, s.
    """

    name: ClassVar[str] = "oblique"

    hold: float = 7.5

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        require(self.hold > 0, f"excitation.hold = {self.hold}: must be positive")

    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return the directions of one run; see the base class."""
        count = int(np.ceil(duration / self.hold)) + 1
        ways = generator.normal(size=(count, 3))
        ways /= np.abs(ways).max(axis=1, keepdims=True)

        def signals(t: Array) -> Array:
            out = np.zeros((len(t), 6))
            out[:, :3] = ways[np.minimum(((t + 1e-9) / self.hold).astype(int), count - 1)]
            return out

        return signals
