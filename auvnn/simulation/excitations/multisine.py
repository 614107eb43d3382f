"""Every degree of freedom at once, open loop: sums of sines, as large as the vehicle bears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.models import GreyBox
from auvnn.simulation.excitations.base import Array, Excitation, Plan, require
from auvnn.simulation.excitations.sizing import driven
from auvnn.simulation.excitations.starts import random_starts
from auvnn.simulation.limits import limits_of

# Of several sets of random phases the one with the lowest peak is taken: more power for the same peak.
PHASE_SETS = 8


@dataclass(frozen=True)
class Multisine(Excitation):
    """Random-phase multisines, different in each degree of freedom and run.

    s(t) = sum_j f_j^(-1/2) sin(2 pi f_j t + phase_j), one f_j drawn from each of `lines` equal parts of the
    band. The size is the one, of a grid tried on the nominal model, that excites all degrees of freedom most
    while roll and pitch stay within `tilt`, the vehicle stays under water and no thruster leaves its limits.

    Attributes:
        low: lower end of the band, Hz.
        high: upper end of the band, Hz.
        lines: sines per degree of freedom.
        effort: largest share of a thruster's limit (of a fin's stall angle, of a wrench's range).
        tilt: largest roll and pitch aimed at, rad.
        depth: at the start, m.
    """

    name: ClassVar[str] = "multisine"

    low: float = 0.02
    high: float = 0.5
    lines: int = 12
    effort: float = 0.95
    tilt: float = 0.52
    depth: float = 8.0

    def __post_init__(self) -> None:
        """Check the options."""
        require(0.0 < self.low < self.high, f"excitation: low = {self.low} must lie between 0 and high")
        require(self.lines >= 1, f"excitation.lines = {self.lines}: at least 1 is needed")
        require(0.0 < self.effort <= 1.0, f"excitation.effort = {self.effort}: must lie in (0, 1]")
        require(0.0 < self.tilt <= 1.5, f"excitation.tilt = {self.tilt}: must lie in (0, 1.5]")

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Draw the signals and choose their size; see the base class."""
        limits = limits_of(model)
        depth, most = self.depth, self.tilt
        if limits.steady is not None:
            # Under way a little lift makes for much depth, and without it pitch is hardly excited.
            depth, most = max(depth, 20.0 * model.vehicle.length), 1.5 * most
        starts = random_starts(generators, depth, 0.15, limits.steady)
        signals = [self._drawn(float(t[-1]), 6 + limits.fins, g) for g in generators]
        return driven(
            model, limits, t, starts, lambda at: np.stack([s(at) for s in signals]), self.effort, most
        )

    def _drawn(self, duration: float, count: int, generator: np.random.Generator) -> _Signals:
        low = max(self.low, min(1.0 / duration, 0.5 * self.high))
        edges = np.linspace(low, self.high, self.lines + 1)
        frequency = edges[:-1] + np.diff(edges) * generator.uniform(0.0, 1.0, (count, self.lines))
        phases = generator.uniform(0.0, 2.0 * np.pi, (PHASE_SETS, count, self.lines))
        # Of a very short run too, the size must not hang on the few samples that it has.
        coarse = np.arange(0.0, max(duration, 10.0), 0.1)
        tried = np.stack([_Signals(frequency, p, np.ones(count))(coarse) for p in phases])
        peak = np.abs(tried).max(axis=1)
        best = peak.argmin(axis=0)
        chosen = phases[best, np.arange(count)]
        return _Signals(frequency, chosen, peak[best, np.arange(count)])


class _Signals:
    """One multisine per degree of freedom, each divided by its peak."""

    def __init__(self, frequency: Array, phase: Array, peak: Array) -> None:
        self.frequency, self.phase, self.peak = frequency, phase, peak

    def __call__(self, t: Array) -> Array:
        """Return the values (T, count)."""
        angle = 2.0 * np.pi * self.frequency[:, :, None] * t + self.phase[:, :, None]
        weight = self.frequency[:, :, None] ** -0.5
        return ((weight * np.sin(angle)).sum(axis=1) / self.peak[:, None]).T
