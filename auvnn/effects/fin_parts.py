"""What effects on fins share: the fins' geometry, their lift, and what they lack without any."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import Effect, Moment
from auvnn.physics.fins import fin_frame, fin_wrench


def fin_names(vehicle: Any) -> tuple[str, ...]:
    """Return the fins' names; one where there are none, so that there is something to describe."""
    return tuple(f"fin_{i + 1}" for i in range(max(len(vehicle.fins), 1)))


class FinEffect(Effect):
    """An effect on fins: the difference that it makes to their wrench."""

    channels = ("fin_1",)

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model file must state: fins."""
        return () if vehicle.fins else ("fins",)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the fins."""
        self.present = bool(vehicle.fins)
        if not self.present:
            return
        place, axis = (
            torch.tensor(np.array([getattr(f, n) for f in vehicle.fins])) for n in ("position", "axis")
        )
        self.keep("frame", fin_frame(place, axis).numpy())
        for name in ("area", "lift_slope", "stall"):
            self.keep(name, [float(getattr(f, name)) for f in vehicle.fins])
        self.keep("density", vehicle.water_density)

    def angles(self, moment: Moment) -> Tensor:
        """Return the fin angles of the log, rad, (..., m); zero where it has none."""
        if moment.fins is None:
            return torch.zeros_like(self.kept("stall").to(moment.nu))
        return moment.fins.to(moment.nu)

    def lift(
        self, moment: Moment, angles: Tensor, share: Tensor | float = 1.0, stall: Tensor | None = None
    ) -> Tensor:
        """Return the lift's wrench at fin angles, each fin's by its share, (..., 6).

        Args:
            moment: state and water at the fins.
            angles: of the fins, rad, (..., m).
            share: of each fin's area that lifts, broadcast to (..., m).
            stall: angle at which each fin stalls, rad, (m,); as stated by default.
        """
        frame, area, slope, stated, density = (
            self.kept(n).to(moment.nu) for n in ("frame", "area", "lift_slope", "stall", "density")
        )
        return fin_wrench(
            moment.nu_r, angles, frame, share * area, slope, stated if stall is None else stall, density
        )
