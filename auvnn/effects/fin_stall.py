"""Fins that stall earlier or later than the model says."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.physics.fins import fin_frame, fin_wrench


class FinStall(Effect):
    """Factor on the angle at which all fins stall; the wrench is the difference that it makes.

    Reference: Beard and McLain (2012), section 4.2, for the lift beyond the stall.
    """

    name = "fin_stall"
    cause = "the fins stall at another angle"
    symbol = "alpha_0"
    reference = "Beard and McLain (2012), Small Unmanned Aircraft, section 4.2"
    confused_with = ("body_lift",)
    manoeuvre = "survey"
    told_apart_by = "large fin angles at constant speed"
    channels = ("fin_1",)

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model file must state: fins."""
        return () if vehicle.fins else ("fins",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factor."""
        return (Parameter("factor", "1", 1.0, 0.3, 0.2, 4.0),)

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

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the lift with the other stall less the lift with the stated one."""
        if not self.present:
            return torch.zeros_like(moment.nu)
        frame, area, slope, stall, density = (
            self.kept(n).to(moment.nu) for n in ("frame", "area", "lift_slope", "stall", "density")
        )
        angle = torch.zeros_like(stall) if moment.fins is None else moment.fins.to(moment.nu)
        later = stall * self.theta[0].to(stall)
        with_factor = fin_wrench(moment.nu_r, angle, frame, area, slope, later, density)
        return with_factor - fin_wrench(moment.nu_r, angle, frame, area, slope, stall, density)
