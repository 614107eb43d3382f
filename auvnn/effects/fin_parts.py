"""What effects on fins share: the fins' geometry, their lift, and what they lack without any."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import Body, Effect, Moment
from auvnn.effects.hooks import FinLift
from auvnn.physics.fins import SHARPNESS, fin_frame, fin_wrench


def fin_names(vehicle: Any) -> tuple[str, ...]:
    """Return the fins' names; one where there are none, so that there is something to describe."""
    return tuple(f"fin_{i + 1}" for i in range(max(len(vehicle.fins), 1)))


class FinEffect(Effect):
    """An effect on fins."""

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

    def now(self, moment: Moment) -> FinLift:
        """Return how the fins lift with the effects before this one; their angles are zero where the log has none."""
        if moment.fin_lift is not None:
            return moment.fin_lift
        if moment.fins is None:
            return FinLift(torch.zeros_like(self.kept("stall").to(moment.nu)))
        return FinLift(moment.fins.to(moment.nu))


class LiftEffect(FinEffect):
    """An effect on the fins' lift: the difference that it makes to their wrench, after the effects on fins before it.

    Factors, angles and stall act together in one lift: a fin in the hull's wake that stalls late has the share of the
    lift with the late stall.
    """

    def changed(self, lift: FinLift) -> FinLift:
        """Return how the fins lift with this effect."""
        return lift

    def onward(self, moment: Moment) -> Moment:
        """Return the moment in which the fins lift as they do with this effect."""
        return replace(moment, fin_lift=self.changed(self.now(moment))) if self.present else moment

    def lift(self, moment: Moment, lift: FinLift) -> Tensor:
        """Return the wrench of the fins' lift, (..., 6).

        Args:
            moment: state and water at the fins.
            lift: how they lift.
        """
        frame, area, slope, stall, density = (
            self.kept(n).to(moment.nu) for n in ("frame", "area", "lift_slope", "stall", "density")
        )
        return fin_wrench(
            moment.nu_r,
            lift.angles,
            frame,
            lift.share * area,
            slope,
            stall * lift.stall,
            density,
            SHARPNESS * lift.sharpness,
            lift.separated,
            lift.crossflow,
        )

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the lift with the effect less the lift without it."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        now = self.now(moment)
        return self.lift(moment, self.changed(now)) - self.lift(moment, now)
