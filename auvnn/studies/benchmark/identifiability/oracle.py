"""An oracle that knows a world's laws, but neither coefficients nor the force that wanders: what it sees in a log.

At the truth, the hidden effect shifts what one step of the plant makes of the true state, and what the sensors report of
it; a filter that is conditional on the past turns that into shifts of its innovations. The distance between two
explanations is that of their shifts in standard errors, the coefficients free within what is stated of them, a rival's
parameters free within their bounds. It is exact to first order in the states and exact in the size of the effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import FREE
from auvnn.diagnosis.score_tests.probes import extent_of
from auvnn.effects import Parameter, effect_class
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.simulation import Simulation
from auvnn.simulation.noise import make_noise
from auvnn.studies.benchmark.identifiability.oracle_filter import Noise, information
from auvnn.studies.benchmark.identifiability.oracle_slopes import (
    Course,
    accelerations,
    differences,
    reports,
    transitions,
)

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, float]]

NONE = "nothing"
# What is stated of a vehicle with an uncertainty, and the axes that it has.
COEFFICIENTS = {
    "added_mass": "XYZKMN",
    "linear_damping": "XYZKMN",
    "quadratic_damping": "XYZKMN",
    "inertia": "KMN",
}
SHARE = 1e-3
CHANNELS = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")


@dataclass(frozen=True)
class Column:
    """One thing that is not known: whose it is, how far it may go, and its prior precision."""

    owner: str
    low: float
    high: float
    precision: float


class Oracle:
    """What can be said about a simulated log by an oracle that knows the world.

    Args:
        model: what the user knows.
        made: the simulation, by an independent plant.
        runs: how many of its runs are the log.
        hidden: names of what is hidden and shall be seen: effects, or strangers to the catalogue.
    """

    def __init__(self, model: GreyBox, made: Simulation, runs: int, hidden: Sequence[str]) -> None:
        """Work out the filter's matrices."""
        assert made.task is not None and made.motion is not None
        self.model, self.made, self.hidden = model, made, list(hidden)
        self.course = Course.of(made.task, made.motion, runs)
        self.truth: dict[str, dict[str, float]] = {n: dict(v) for n, v in made.task.effects.items()}
        self.numbers = [run.number for run in made.log.runs][:runs]
        world = made.truth.get("world") or {}
        force = (world.get("drawn") or {}).get("force") or {"rms": [0.0] * 6, "correlation": [1.0] * 6}
        self.noise = self._noise(world, np.array(force["rms"]), np.array(force["correlation"]))
        self.transition = transitions(self.course, self.truth, self.noise.correlation)
        self.now = accelerations(self.course, self.truth), reports(self.course, self.truth)
        # How an acceleration over a step ends up in position, attitude and velocity.
        _, rotation, _ = self.course.middle()
        h = self.course.step
        self.spread = np.zeros((*rotation.shape[:2], 12, 6))
        self.spread[..., :3, :3], self.spread[..., 3:6, 3:] = 0.5 * h * h * rotation, 0.5 * h * h * np.eye(3)
        self.spread[..., 6:, :] = h * np.eye(6)

    def _noise(self, world: Mapping[str, Any], rms: Array, correlation: Array) -> Noise:
        condition = make_noise(self.made.truth["conditions"]["noise"])
        sigma = np.maximum(condition.sizes(CHANNELS)[0], 1e-6)
        sensors = world.get("sensors") or {}
        course, log = self.course, self.made.log
        every = round((len(course.task.t) - 1) / (len(log.runs[0].t) - 1))
        measured = np.zeros((course.runs, len(course.rows), 12), dtype=bool)
        rate = float(sensors.get("velocity_rate") or 0.0)
        dt = float(course.task.t[1] - course.task.t[0])
        hold = max(1, round(1.0 / (rate * dt))) if rate else 1
        for i in range(course.runs):
            run = log.runs[i]
            assert run.position is not None
            parts = [np.isfinite(x) for x in (run.position, run.quaternion[:, 1:], run.nu)]
            present = np.concatenate(parts, axis=1)
            for k, row in enumerate(course.rows):
                if row % every == 0:
                    measured[i, k] = present[row // every]
                    measured[i, k, 6:9] &= row % hold == 0
        late = float(sensors.get("jitter") or 0.0)
        motion, rows = course.motion, course.rows
        nu, nu_dot = motion.nu[:, rows], motion.nu_dot[:, rows]
        moving = np.concatenate([nu[..., :3], nu[..., 3:], nu_dot], axis=-1)
        return Noise(
            sigma, float(sensors.get("correlation") or 0.0), (late * moving) ** 2, measured, rms, correlation
        )

    def _shift(self, other: Values, course: Course | None = None) -> tuple[Array, Array]:
        """Return what other effects would change, in a step (R, K, 12) and in the reports (R, K + 1, 12).

        Args:
            other: effects in the place of those that act.
            course: the same motion with other strangers; by default with those that act.
        """
        course = course or self.course
        gone = accelerations(course, other) - self.now[0]
        push = np.einsum("rkij,rkj->rki", self.spread, gone)
        return push, differences(self.now[1], reports(course, other))

    def _slopes(self, name: str, shape: Mapping[str, float]) -> list[tuple[Column, Array, Array]]:
        """Return the slopes with each live parameter of an effect that is added, and how far it may go."""
        kind = effect_class(name)
        described = kind.describe(self.model.vehicle, self.model.actuation)
        base = {p.name: p.null for p in described} | dict(shape) | self.truth.get(name, {})
        begin = (
            (np.zeros(()), np.zeros(()))
            if name in self.truth or not shape
            else self._shift({**self.truth, name: base})
        )
        out = []
        for p in described:
            if p.shape:
                continue
            step = SHARE * p.scale * (1.0 if base[p.name] + SHARE * p.scale <= p.high else -1.0)
            push, seen = self._shift({**self.truth, name: {**base, p.name: base[p.name] + step}})
            column = Column(name, p.low - base[p.name], p.high - base[p.name], (FREE * p.scale) ** -2)
            out.append((column, (push - begin[0]) / step, (seen - begin[1]) / step))
        return out

    def _coefficients(self) -> list[tuple[Column, Array, Array]]:
        """Return the slopes with the factors of the stated coefficients."""
        out = []
        for group, axes in COEFFICIENTS.items():
            std = float(self.model.vehicle.uncertainty.get(group, 0.0))
            if std <= 0.0:
                continue
            base = {a: 1.0 for a in axes} | self.truth.get(group, {})
            for axis in axes:
                push, seen = self._shift({**self.truth, group: {**base, axis: base[axis] + SHARE}})
                if np.abs(push).max() > 0.0:
                    out.append((Column(group, -np.inf, np.inf, std**-2.0), push / SHARE, seen / SHARE))
        return out

    def _away(self, name: str) -> tuple[Array, Array]:
        """Return what a hidden effect or stranger changes, all of it: whoever has it not must make up for that."""
        others = {n: v for n, v in self.course.task.strangers.items() if n != name}
        left = {n: v for n, v in self.truth.items() if n != name}
        push, seen = self._shift(left, replace(self.course, task=replace(self.course.task, strangers=others)))
        return -push, -seen

    def distances(self, rivals: Sequence[str] = ()) -> dict[str, dict[str, float]]:
        """Return hidden effect to rival to distance in standard errors, "nothing" being no rival at all."""
        shifts = [self._away(name) for name in self.hidden]
        coefficients = self._coefficients()
        found: dict[str, list[list[tuple[Column, Array, Array]]]] = {NONE: [[]]}
        for rival in rivals:
            if rival not in self.truth:
                found[rival] = [self._slopes(rival, shape) for shape in self._starts(rival)]
        flat = [c for tries in found.values() for columns in tries for c in columns]
        push = np.stack([s[0] for s in shifts] + [c[1] for c in coefficients + flat], axis=-1)
        seen = np.stack([s[1] for s in shifts] + [c[2] for c in coefficients + flat], axis=-1)
        total = information(self.transition, push, seen, self.course.step, self.noise)
        first = len(shifts) + len(coefficients)
        common = list(range(len(shifts), first))
        out: dict[str, dict[str, float]] = {name: {} for name in self.hidden}
        for rival, tries in found.items():
            for columns in tries:
                index = list(range(first, first + len(columns)))
                first += len(columns)
                for i, name in enumerate(self.hidden):
                    others = [j for j in range(len(shifts)) if j != i]
                    free = [Column(n, -np.inf, np.inf, 1e-4) for k, n in enumerate(self.hidden) if k != i]
                    known = [c[0] for c in columns] + free + [c[0] for c in coefficients]
                    miss = _missed(total, i, index + others + common, known)
                    out[name][rival] = min(miss, out[name].get(rival, np.inf))
        return out

    def _starts(self, name: str) -> list[dict[str, float]]:
        kind = effect_class(name)
        described: tuple[Parameter, ...] = kind.describe(self.model.vehicle, self.model.actuation)
        if not any(p.shape for p in described):
            return [{}]
        extent = extent_of(cut_windows(self.made.log.select(self.numbers), 5.0, partial=True))
        return [dict(s) for s in kind.starts(described, extent)]


def _missed(total: Array, mine: int, columns: list[int], known: Sequence[Column]) -> float:
    """Return by how many standard errors the best combination of columns misses a shift."""
    whole = float(total[mine, mine])
    if not columns:
        return float(np.sqrt(max(whole, 0.0)))
    inner = total[np.ix_(columns, columns)] + np.diag([c.precision for c in known])
    gradient = total[columns, mine]
    low, high = (np.array([getattr(c, side) for c in known]) for side in ("low", "high"))
    step = NormalEquations(inner, gradient).bounded(low, high)
    return float(np.sqrt(max(whole - 2.0 * step @ gradient + step @ inner @ step, 0.0)))


__all__ = ["NONE", "Oracle"]
