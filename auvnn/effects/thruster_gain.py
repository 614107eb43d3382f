"""Thrusters (or axes of a commanded wrench) that give more or less than commanded."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.factors import actuators
from auvnn.effects.hooks import Moment, Parameter


class ThrusterGain(Effect):
    """One factor per thruster: T <- k T. With a commanded wrench, one factor per axis.

    Reference: Fossen (2011), section 9; Blue Robotics (2019) for the spread of one type of thruster.
    """

    name = "thruster_gain"
    cause = "a thruster gives more or less than it should"
    symbol = "k_T"
    reference = "Fossen (2011), chapter 9"
    confused_with = ("linear_damping", "quadratic_damping", "thruster_deadband", "voltage_droop")
    manoeuvre = "pulses"
    told_apart_by = "short pushes from rest with each thruster: thrust without drag"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one factor per actuator."""
        return tuple(Parameter(n, "1", 1.0, 0.2, -2.0, 5.0) for n in actuators(vehicle, actuation))

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Scale each actuator."""
        return thrust * self.theta.to(thrust)
