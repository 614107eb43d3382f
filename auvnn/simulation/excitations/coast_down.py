"""Push, then let it coast: drag against inertia, one degree of freedom after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.simulation.excitations.base import Array, require
from auvnn.simulation.excitations.sequence import Manoeuvre, blocks


@dataclass(frozen=True)
class CoastDown(Manoeuvre):
    """Constant thrust along one axis, then none at all: surge, sway, heave and yaw in random order.

    While it coasts nothing acts but drag, inertia, weight and water, so that a wrong thrust cannot pass for any
    of them.

    Attributes:
        push: how long the thrust lasts, s.
        coast: how long it coasts, s.
    """

    name: ClassVar[str] = "coast_down"

    push: float = 6.0
    coast: float = 6.0

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        for name in ("push", "coast"):
            require(getattr(self, name) > 0, f"excitation.{name} = {getattr(self, name)}: must be positive")

    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return the pushes of one run; see the base class."""
        parts = blocks(duration, self.push + self.coast, generator)

        def signals(t: Array) -> Array:
            out = np.zeros((len(t), 6))
            for start, axis, sign in parts:
                out[(t >= start - 1e-9) & (t < start + self.push - 1e-9), axis] = sign
            return out

        return signals
