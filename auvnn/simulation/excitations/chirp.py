"""A step and a swept sine in each degree of freedom: lags, delays and inertia."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.simulation.excitations.base import Array, require
from auvnn.simulation.excitations.sequence import Manoeuvre, blocks


@dataclass(frozen=True)
class Chirp(Manoeuvre):
    """A step, then a sine whose frequency grows exponentially, along one axis after the other.

    Attributes:
        low: first frequency, Hz.
        high: last frequency, Hz.
        step: length of the step before it, s.
        sweep: length of the sweep, s.
    """

    name: ClassVar[str] = "chirp"

    low: float = 0.2
    high: float = 2.0
    step: float = 2.0
    sweep: float = 8.0

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        require(0.0 < self.low < self.high, f"excitation: low = {self.low} must lie between 0 and high")
        require(self.step >= 0, f"excitation.step = {self.step}: must not be negative")
        require(self.sweep > 0, f"excitation.sweep = {self.sweep}: must be positive")

    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return the sweeps of one run; see the base class."""
        parts = blocks(duration, self.step + self.sweep, generator)
        growth = np.log(self.high / self.low) / self.sweep

        def signals(t: Array) -> Array:
            out = np.zeros((len(t), 6))
            for start, axis, sign in parts:
                since = t - start + 1e-9
                first = (since >= 0) & (since < self.step)
                out[first, axis] = sign
                then = (since >= self.step) & (since < self.step + self.sweep)
                phase = self.low * np.expm1(growth * (since[then] - self.step)) / growth
                out[then, axis] = sign * np.cos(2 * np.pi * phase)
            return out

        return signals
