"""Changes of depth (and of altitude), slowly ahead. Closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auvnn.models import GreyBox
from auvnn.simulation.controller import Autopilot, SetPoints
from auvnn.simulation.excitations.base import Array, Excitation, Plan, require
from auvnn.simulation.excitations.starts import random_starts
from auvnn.simulation.limits import limits_of, top_speed


@dataclass(frozen=True)
class Dives(Excitation):
    """Alternating steps of depth at low constant speed and heading.

    Attributes:
        step: change of depth, m; a quarter of it for a vehicle that is steered by fins.
        hold: time between two steps, s.
        speed: share of the highest at which the vehicle stays in hand.
        depth: at the start, m.
    """

    name: ClassVar[str] = "dives"

    step: float = 4.0
    hold: float = 20.0
    speed: float = 0.3
    depth: float = 4.0

    def __post_init__(self) -> None:
        """Check the options."""
        require(self.step > 0, f"excitation.step = {self.step}: must be positive")
        require(self.hold > 0, f"excitation.hold = {self.hold}: must be positive")
        require(0 < self.speed <= 1, f"excitation.speed = {self.speed}: must lie in (0, 1]")

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Return the steps; runs alternate in whether they begin downwards; see the base class."""
        limits = limits_of(model)
        depth, speed, hold, step = self.depth, self.speed * top_speed(model, limits), self.hold, self.step
        if limits.steady is not None:
            # It dives by pitching: large steps would stall its fins.
            depth, speed = max(depth, 8 * model.vehicle.length), limits.steady.nu[0]
            hold, step = 2.0 * hold, 0.25 * step
        eta0, nu0 = random_starts(generators, depth, 0.05, limits.steady)
        yaw0 = 2.0 * np.arctan2(eta0[:, 6], eta0[:, 3])
        shape = (len(generators), len(t))
        phase = ((t + 1e-9) / hold).astype(int)[None] + np.arange(len(generators))[:, None]
        points = SetPoints(
            np.broadcast_to(yaw0[:, None], shape).copy(),
            np.full(shape, float(speed)),
            depth + step * (phase % 2 == 0),
        )
        controller = Autopilot(model, limits, points, float(t[1] - t[0]))
        under_way = limits.steady is not None
        return Plan(eta0, nu0, controller=controller, under_way=under_way, set_points=points.to_dict())
