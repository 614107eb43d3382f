"""A gyroscope with a bias."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed


class GyroBias(Effect):
    """Reported angular rate: omega + b, constant in body axes; attitude and accelerations are not touched.

    Reference: Fossen (2011), section 11.5 (bias model of inertial sensors).
    """

    name = "gyro_bias"
    cause = "the gyroscope has a bias"
    symbol = "b_g"
    reference = "Fossen (2011), section 11.5"
    confused_with = ("velocity_lever_arm",)
    manoeuvre = "survey"
    told_apart_by = "lying still, then turning both ways"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the bias about each axis."""
        return tuple(Parameter(n, "rad/s", 0.0, 0.01, -1.0, 1.0) for n in "pqr")

    def sense(self, sensed: Sensed) -> Sensed:
        """Add the bias."""
        bias: Tensor = torch.nn.functional.pad(self.theta.to(sensed.nu), (3, 0))
        return replace(sensed, nu=sensed.nu + bias)
