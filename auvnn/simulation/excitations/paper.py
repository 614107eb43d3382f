"""The manoeuvre of the paper: one constant wrench, then nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from auvnn.models import GreyBox
from auvnn.simulation.allocation import Allocation
from auvnn.simulation.excitations.base import Array, Excitation, Plan, require

# Where thrusters give less than this share of what is wanted, the log's truth says so.
SHORT = 0.01


@dataclass(frozen=True)
class Paper(Excitation):
    """tau = [F F F M M M] for a time, then zero; from rest, level, heading north.

    A vehicle that is commanded by its thrusters gets the commands that come nearest, within their limits;
    what then differs from the paper's wrench is said in the notes. All runs are the same but for the noise.

    Attributes:
        force: F, N.
        moment: M, N m.
        time: how long, s.
        depth: at the start, m.

    Reference: Van de Ven, Johansen, Sorensen, Flanagan and Toal, IFAC CAMS 2004, case I.
    """

    name: ClassVar[str] = "paper"

    force: float = 100.0
    moment: float = 10.0
    time: float = 15.0
    depth: float = 5.0

    def __post_init__(self) -> None:
        """Check the options."""
        require(self.time > 0.0, f"excitation.time = {self.time}: must be greater than zero")

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Return the same plan for every run; see the base class."""
        runs = len(generators)
        wanted = np.array([self.force] * 3 + [self.moment] * 3)
        notes: tuple[str, ...] = ()
        held = wanted
        if model.actuation == "thrusters":
            allocation = Allocation(model.vehicle)
            held = allocation.command(allocation.thrust(wanted))
            given = allocation.matrix @ model.actuators.static(torch.tensor(held)).numpy()
            if np.abs(given - wanted).max() > SHORT * np.abs(wanted).max():
                notes = (
                    f"the thrusters of {model.vehicle.name} give {_words(given)} instead of {_words(wanted)} "
                    "(N, N m): what they cannot reach is cut",
                )
        # The row at `time` itself is already zero, so that the wrench acts for exactly that long.
        on = (t < self.time - 1e-9).astype(np.float64)
        command = np.tile(on[:, None] * held, (runs, 1, 1))
        eta0 = np.tile([0.0, 0.0, self.depth, 1.0, 0.0, 0.0, 0.0], (runs, 1))
        fins = np.zeros((runs, len(t), len(model.vehicle.fins))) if model.vehicle.fins else None
        return Plan(eta0, np.zeros((runs, 6)), command, fins, notes=notes)


def _words(wrench: Array) -> str:
    return "[" + " ".join(f"{value:.3g}" for value in np.round(wrench, 6) + 0.0) + "]"
