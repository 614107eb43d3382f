"""A survey under a simple controller: steps of heading, speed and depth, in closed loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.models import GreyBox
from auvnn.simulation.controller import Autopilot, SetPoints
from auvnn.simulation.excitations.base import Array, Excitation, Plan, require
from auvnn.simulation.excitations.starts import random_starts
from auvnn.simulation.limits import limits_of, top_speed


@dataclass(frozen=True)
class Survey(Excitation):
    """Steps of heading, speed and depth at random times, another sequence in each run.

    Attributes:
        hold: shortest and longest time between two steps of one channel, s.
        heading: smallest and largest step, rad; the sign is random.
        speed: lowest and highest speed as a share of the highest at which the vehicle stays in hand; one that
            is steered by fins keeps near its cruising speed, and takes half the turns in twice the time.
        climb: largest distance from the first depth, m.
        depth: at the start, m.
    """

    name: ClassVar[str] = "survey"

    hold: tuple[float, float] = (8.0, 16.0)
    heading: tuple[float, float] = (0.5, 2.0)
    speed: tuple[float, float] = (0.2, 1.0)
    climb: float = 1.0
    depth: float = 5.0

    def __post_init__(self) -> None:
        """Check the options."""
        for name in ("hold", "heading", "speed"):
            low, high = getattr(self, name)
            require(0.0 < low <= high, f"excitation.{name} = [{low}, {high}]: 0 < low <= high is needed")
        require(self.heading[1] < np.pi, "excitation.heading: a step of pi or more has no direction")
        require(self.climb >= 0.0, f"excitation.climb = {self.climb}: must not be negative")

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Draw the set points and hand them to a controller; see the base class."""
        limits = limits_of(model)
        depth = self.depth if limits.steady is None else max(self.depth, 8.0 * model.vehicle.length)
        eta0, nu0 = random_starts(generators, depth, 0.05, limits.steady)
        slow, fast = (share * top_speed(model, limits) for share in self.speed)
        patience = 1.0
        if limits.steady is not None:
            slow, fast, patience = 0.95 * limits.steady.nu[0], 1.05 * limits.steady.nu[0], 2.0
        yaw0 = 2.0 * np.arctan2(eta0[:, 6], eta0[:, 3])

        def steps(
            generator: np.random.Generator, following: Callable[[float], float], at_once: bool = False
        ) -> Array:
            values, value = np.zeros(len(t)), 0.0
            moment = 0.0 if at_once else patience * self.hold[0] * generator.uniform(0.3, 1.0)
            while moment <= t[-1]:
                value = following(value)
                values[t >= moment] = value
                moment += patience * generator.uniform(*self.hold)
            return values

        wanted = [
            np.stack([
                yaw + steps(g, lambda last, g=g: last + self._turn(g) / patience),
                steps(g, lambda _, g=g: g.uniform(slow, fast), at_once=True),
                depth + steps(g, lambda _, g=g: g.uniform(-self.climb, self.climb)),
            ])
            for g, yaw in zip(generators, yaw0, strict=True)
        ]  # fmt: skip
        points = SetPoints(*np.moveaxis(np.stack(wanted), 1, 0))
        controller = Autopilot(model, limits, points, float(t[1] - t[0]))
        under_way = limits.steady is not None
        return Plan(eta0, nu0, controller=controller, under_way=under_way, set_points=points.to_dict())

    def _turn(self, generator: np.random.Generator) -> float:
        return float(generator.choice([-1.0, 1.0]) * generator.uniform(*self.heading))
