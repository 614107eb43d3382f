"""What the open-loop manoeuvres have in common: signals drawn by run, driven as hard as the vehicle bears."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.simulation.excitations.base import Array, Excitation, Plan, require
from auvnn.simulation.excitations.sizing import driven
from auvnn.simulation.excitations.starts import random_starts
from auvnn.simulation.limits import limits_of

# Surge, sway, heave and yaw: what a hovering vehicle is driven in; roll and pitch follow its stiffness.
DRIVEN = (0, 1, 2, 5)


@dataclass(frozen=True)
class Manoeuvre(Excitation):
    """A manoeuvre of a hovering vehicle whose signals are a function of time, drawn again for each run.

    Attributes:
        effort: largest share of a thruster's limit (of a wrench's range).
        tilt: largest roll and pitch aimed at, rad.
        depth: at the start, m.
    """

    effort: float = 0.95
    tilt: float = 0.52
    depth: float = 8.0

    def __post_init__(self) -> None:
        """Check the options."""
        require(0.0 < self.effort <= 1.0, f"excitation.effort = {self.effort}: must lie in (0, 1]")
        require(0.0 < self.tilt <= 1.5, f"excitation.tilt = {self.tilt}: must lie in (0, 1.5]")

    @abstractmethod
    def drawn(self, duration: float, generator: np.random.Generator) -> Callable[[Array], Array]:
        """Return one run's signals, with peak one: times (T,), s, to the six degrees of freedom, (T, 6)."""

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Draw the signals and choose their size; see the base class.

        Raises:
            ConfigError: the vehicle must move to be steered.
        """
        limits = limits_of(model)
        if limits.steady is not None:
            raise ConfigError(
                f"excitation={self.name} needs a vehicle that can hover; for {model.vehicle.name} take survey, "
                "reciprocal, dives or multisine"
            )
        starts = random_starts(generators, self.depth, 0.05)
        signals = [self.drawn(float(t[-1]), g) for g in generators]

        def together(at: Array) -> Array:
            unit = np.stack([s(at) for s in signals])
            return np.concatenate([unit, np.zeros((*unit.shape[:2], limits.fins))], axis=-1)

        return driven(model, limits, t, starts, together, self.effort, self.tilt)


def blocks(duration: float, length: float, generator: np.random.Generator) -> list[tuple[float, int, float]]:
    """Return (start, s; axis; sign) of blocks of a length, each axis in turn in a random order.

    Args:
        duration: of the run, s.
        length: of a block, s.
        generator: draws the order and the signs.
    """
    found, start = [], 0.0
    while start < duration:
        for axis in generator.permutation(DRIVEN):
            found.append((start, int(axis), float(generator.choice([-1.0, 1.0]))))
            start += length
    return found
