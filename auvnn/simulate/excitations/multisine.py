"""Every degree of freedom at once, open loop: sums of sines, as large as the vehicle bears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from auvnn.models import GreyBox, Inputs
from auvnn.simulate.cruise import over_ground
from auvnn.simulate.excitations.base import Array, Excitation, Plan, require
from auvnn.simulate.excitations.starts import random_starts
from auvnn.simulate.limits import Limits, limits_of

# Of several sets of random phases the one with the lowest peak is taken: more power for the same peak.
PHASE_SETS = 8
# Trial runs on the nominal model choose the size: of everything, and of roll and pitch (or fins) beside it.
EFFORTS = (0.1, 0.13, 0.18, 0.24, 0.32, 0.42, 0.56, 0.75, 1.0)
TILTS = (0.02, 0.06, 0.12, 0.25, 0.5, 1.0)
TRIAL_STEP, TRIAL_TIME = 0.1, 80.0


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
        eta0, nu0 = random_starts(generators, depth, 0.15, limits.steady)
        signals = [self._drawn(float(t[-1]), 6 + limits.fins, g) for g in generators]
        effort, tilt = self._sizes(model, limits, t, eta0, nu0, signals, most)
        unit = np.stack([s(t) for s in signals])
        command, fins = limits.drive(unit, effort[:, None, None], tilt[:, None, None])
        return Plan(eta0, nu0, command, fins, under_way=limits.steady is not None)

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

    def _sizes(
        self,
        model: GreyBox,
        limits: Limits,
        t: Array,
        eta0: Array,
        nu0: Array,
        signals: list[_Signals],
        most: float,
    ) -> tuple[Array, Array]:
        """Return effort and tilt by run, each the best of the grid."""
        times = np.arange(0.0, min(TRIAL_TIME, float(t[-1])) + 1e-9, TRIAL_STEP)
        unit = np.stack([s(times) for s in signals])
        # Slow, the fins would have no hold on the water.
        efforts = EFFORTS if limits.steady is None else EFFORTS[-1:]
        pairs = np.array([(e, a) for e in efforts for a in TILTS])
        effort, tilt = self.effort * pairs[:, 0, None, None, None], pairs[:, 1, None, None, None]
        command, fins = limits.drive(unit[None], effort, tilt)
        shape = (len(pairs), len(signals))
        inputs = Inputs(
            _tensor(command), None if fins is None else _tensor(fins), limits.voltage(shape, times)
        )
        eta, nu = _tensor(np.broadcast_to(eta0, (*shape, 7))), _tensor(np.broadcast_to(nu0, (*shape, 6)))
        if limits.steady is not None:
            nu = over_ground(model, eta, nu)
        run = model.rollout(eta, nu, inputs, _tensor(times), max_step=TRIAL_STEP, check=False)
        score = _score(run.eta.numpy(), run.nu.numpy(), most)
        best = score.argmax(axis=0)
        return pairs[best, 0] * self.effort, pairs[best, 1]


class _Signals:
    """One multisine per degree of freedom, each divided by its peak."""

    def __init__(self, frequency: Array, phase: Array, peak: Array) -> None:
        self.frequency, self.phase, self.peak = frequency, phase, peak

    def __call__(self, t: Array) -> Array:
        """Return the values (T, count)."""
        angle = 2.0 * np.pi * self.frequency[:, :, None] * t + self.phase[:, :, None]
        weight = self.frequency[:, :, None] ** -0.5
        return ((weight * np.sin(angle)).sum(axis=1) / self.peak[:, None]).T


def _score(eta: Array, nu: Array, tilt: float) -> Array:
    """Return how well each trial (S, R) excites; those out of bounds count by how far they are out."""
    w, x, y, z = np.moveaxis(eta[..., 3:], -1, 0)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
        leaning = np.maximum(np.abs(roll), np.abs(pitch)).max(axis=-1) / tilt
        depth = eta[..., 0, 2]
        rising = (depth - eta[..., 2].min(axis=-1)) / np.maximum(depth - 1.0, 0.5)
        over = np.maximum(np.maximum(leaning, rising) - 1.0, 0.0)
        score = np.log(nu.std(axis=-2) + 1e-3).sum(axis=-1)
    score = np.where(over > 0, -1e3 - over, score)
    return np.where(np.isfinite(nu).all(axis=(-1, -2)) & np.isfinite(over), score, -np.inf)


def _tensor(array: Array) -> torch.Tensor:
    return torch.tensor(np.ascontiguousarray(array))
