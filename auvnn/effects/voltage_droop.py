"""Thrust that follows the battery."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Moment, Parameter


class VoltageDroop(Effect):
    """Open-loop drives: T <- T (V / V_ref)^exponent, with the voltage as logged.

    The reference is the one at which the model file's thrust limits hold. The exponent is 2 where revolutions
    follow the voltage, and 0 for drives that hold their revolutions.
    Reference: Blue Robotics (2019), T200 performance data at 10 to 20 V.
    """

    name = "voltage_droop"
    cause = "thrust follows the battery's voltage"
    symbol = "gamma_V"
    reference = "Blue Robotics (2019), T200 performance data"
    confused_with = ("biofouling", "thruster_gain")
    manoeuvre = "pulses"
    told_apart_by = "the same pushes with a full and an empty battery"
    plainer = ("thruster_gain",)
    channels = ("voltage",)

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model file must state for the effect to mean anything."""
        return () if vehicle.reference_voltage else ("reference_voltage",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the exponent; 1.2 was measured."""
        return (Parameter("exponent", "1", 0.0, 1.2, -10.0, 10.0),)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the reference voltage; without one there is nothing to compare with."""
        self.reference_voltage = vehicle.reference_voltage

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Scale the thrust; a log without voltage leaves it as it is."""
        if moment.voltage is None or not self.reference_voltage:
            return thrust
        ratio = moment.voltage.to(thrust) / self.reference_voltage
        return thrust * (ratio.clamp_min(1e-3) ** self.theta[0].to(thrust)).unsqueeze(-1)
