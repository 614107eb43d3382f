"""Pure rotation: moments without force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.simulation.excitations.base import Array, require
from auvnn.simulation.excitations.sequence import Manoeuvre

# Sines per axis.
LINES = 6


@dataclass(frozen=True)
class Rotation(Manoeuvre):
    """Multisine moments about the three axes and no force: what turns the vehicle, apart from what drives it.

    Attributes:
        low: lower end of the band, Hz.
        high: upper end of the band, Hz.
    """

    name: ClassVar[str] = "rotation"

    low: float = 0.05
    high: float = 0.5

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        require(0.0 < self.low < self.high, f"excitation: low = {self.low} must lie between 0 and high")

    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return the moments of one run; see the base class."""
        edges = np.linspace(self.low, self.high, LINES + 1)
        frequency = edges[:-1] + np.diff(edges) * generator.uniform(size=(3, LINES))
        phase = generator.uniform(0.0, 2 * np.pi, (3, LINES))
        weight = frequency**-0.5 / (frequency**-0.5).sum(axis=1, keepdims=True)

        def signals(t: Array) -> Array:
            out = np.zeros((len(t), 6))
            angle = 2 * np.pi * frequency[..., None] * t + phase[..., None]
            out[:, 3:] = (weight[..., None] * np.sin(angle)).sum(axis=1).T
            return out

        return signals
