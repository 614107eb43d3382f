"""Thrusters whose shares of the stated thrust differ between ahead and astern."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.factors import actuators
from auvnn.effects.hooks import Moment, Parameter


class ThrustAsymmetry(Effect):
    """One asymmetry per thruster: T_i <- T_i (1 + a_i sign(T_i)). With a commanded wrench, one per axis.

    The thrust ahead is 1 + a times, the one astern 1 - a times the stated one: their mean gain stays, which is
    `thruster_gain`. A thruster that works in both directions leaves a mean force where a is not zero, which a constant
    force imitates as long as it works equally hard. Propellers and ducts are made for one direction: of the T200 the
    curve astern reaches about 80 % of that ahead. Reference: Blue Robotics (2019), T200 data; Carlton (2012), Marine
    Propellers and Propulsion, chapter 6 (four quadrants).
    """

    name = "thrust_asymmetry"
    cause = "a thruster gives more than stated ahead and less astern, or the reverse"
    symbol = "a_T"
    reference = "Carlton (2012), Marine Propellers and Propulsion, chapter 6"
    confused_with = ("thruster_gain", "constant_force", "thruster_deadband")
    manoeuvre = "pulses"
    told_apart_by = "short pushes from rest with each thruster, ahead and astern, weak and hard"
    plainer = ("thruster_gain",)
    leaves = ("constant_force", "net_buoyancy")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one asymmetry per actuator."""
        return tuple(Parameter(n, "1", 0.0, 0.1, -1.0, 1.0) for n in actuators(vehicle, actuation))

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Scale each actuator by its direction."""
        return thrust * (1.0 + self.theta.to(thrust) * torch.sign(thrust))
