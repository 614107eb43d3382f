"""Reciprocal headings: the same speed there and back, and across. Closed loop."""

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

# There, back, across, back across: what comes from the water turns with the heading, what comes from the body does not.
LEGS = np.radians([0.0, 180.0, 90.0, 270.0])


@dataclass(frozen=True)
class Reciprocal(Excitation):
    """Straight legs at constant speed and depth on four headings.

    Attributes:
        leg: time on each heading, turn included, s.
        speed: share of the highest at which the vehicle stays in hand.
        depth: at the start, m.
    """

    name: ClassVar[str] = "reciprocal"

    leg: float = 15.0
    speed: float = 0.7
    depth: float = 8.0

    def __post_init__(self) -> None:
        """Check the options."""
        require(self.leg > 0, f"excitation.leg = {self.leg}: must be positive")
        require(0 < self.speed <= 1, f"excitation.speed = {self.speed}: must lie in (0, 1]")

    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Return the legs, each run with a separate first heading; see the base class."""
        limits = limits_of(model)
        depth, speed, leg = self.depth, self.speed * top_speed(model, limits), self.leg
        if limits.steady is not None:
            # It turns slowly, and only under way.
            depth, speed, leg = max(depth, 8 * model.vehicle.length), limits.steady.nu[0], 2.0 * leg
        eta0, nu0 = random_starts(generators, depth, 0.05, limits.steady)
        yaw0 = 2.0 * np.arctan2(eta0[:, 6], eta0[:, 3])
        turn = LEGS[((t + 1e-9) / leg).astype(int) % len(LEGS)]
        shape = (len(generators), len(t))
        points = SetPoints(yaw0[:, None] + turn, np.full(shape, float(speed)), np.full(shape, float(depth)))
        controller = Autopilot(model, limits, points, float(t[1] - t[0]))
        under_way = limits.steady is not None
        return Plan(eta0, nu0, controller=controller, under_way=under_way, set_points=points.to_dict())
