"""A velocity sensor that is mounted off the body origin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed


class VelocityLeverArm(Effect):
    """Velocity sensor at r from the body origin: it reports v + omega x r, and its derivative.

    Reference: Hegrenaes and Hallingstad (2011), IEEE JOE 36(2).
    """

    name = "velocity_lever_arm"
    cause = "the velocity sensor is not at the body origin"
    symbol = "r_v"
    reference = "Hegrenaes and Hallingstad (2011), IEEE JOE 36(2)"
    confused_with = ("gyro_bias", "coupled_damping")
    manoeuvre = "rotation"
    told_apart_by = "turning on the spot"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the sensor's place in body axes."""
        length = float(vehicle.length)
        return tuple(Parameter(n, "m", 0.0, 0.1 * length, -2 * length, 2 * length) for n in "xyz")

    def _shifted(self, nu: Tensor) -> Tensor:
        arm = self.theta.to(nu).expand_as(nu[..., 3:])
        return torch.cat([nu[..., :3] + torch.linalg.cross(nu[..., 3:], arm), nu[..., 3:]], dim=-1)

    def sense(self, sensed: Sensed) -> Sensed:
        """Report the velocity of the sensor's place instead of the origin's."""
        rate = None if sensed.nu_dot is None else self._shifted(sensed.nu_dot)
        return replace(sensed, nu=self._shifted(sensed.nu), nu_dot=rate)
