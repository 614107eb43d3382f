"""Short pushes from rest: thrust and inertia, hardly any drag. The free vehicle's bollard test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.simulation.excitations.base import Array, require
from auvnn.simulation.excitations.sequence import Manoeuvre, blocks

# Shares of full effort: a wrong curve of the thrusters shows in how the answer grows with them.
LEVELS = (0.15, 0.3, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Pulses(Manoeuvre):
    """Pairs of opposite pushes at random levels, along one axis after the other, with rest between them.

    Attributes:
        push: length of each of the two pushes, s.
        rest: until the next pair, s.
    """

    name: ClassVar[str] = "pulses"

    push: float = 0.6
    rest: float = 1.8

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        for name in ("push", "rest"):
            require(getattr(self, name) > 0, f"excitation.{name} = {getattr(self, name)}: must be positive")

    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return the pushes of one run; see the base class."""
        parts = [
            (*part, float(generator.choice(LEVELS)))
            for part in blocks(duration, 2 * self.push + self.rest, generator)
        ]

        def signals(t: Array) -> Array:
            out = np.zeros((len(t), 6))
            for start, axis, sign, level in parts:
                since = t - start + 1e-9
                out[(since >= 0) & (since < self.push), axis] = sign * level
                out[(since >= self.push) & (since < 2 * self.push), axis] = -sign * level
            return out

        return signals
