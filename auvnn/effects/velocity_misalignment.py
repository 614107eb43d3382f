"""A velocity sensor that is mounted askew."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed
from auvnn.physics.attitude import euler_to_quat, quat_rotate_inverse


class VelocityMisalignment(Effect):
    """Velocity sensor turned by roll, pitch, yaw (ZYX) against the body: it reports R_s' v, about v - eps x v.

    Reference: Hegrenaes and Hallingstad (2011), IEEE JOE 36(2); Kinsey and Whitcomb (2007) for the calibration.
    """

    name = "velocity_misalignment"
    cause = "the velocity sensor is mounted askew"
    symbol = "R_s"
    reference = "Hegrenaes and Hallingstad (2011), IEEE JOE 36(2)"
    confused_with = ("ocean_current", "thruster_gain")
    manoeuvre = "reciprocal"
    told_apart_by = "straight legs on several headings with an independent position fix"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the angles of the sensor's axes in the body; two degrees are plausible."""
        return tuple(Parameter(n, "rad", 0.0, 0.035, -1.5, 1.5) for n in ("yaw", "roll", "pitch"))

    def _turned(self, nu: Tensor) -> Tensor:
        yaw, roll, pitch = self.theta.to(nu).unbind(-1)
        sensor = euler_to_quat(torch.stack([roll, pitch, yaw], dim=-1))
        return torch.cat([quat_rotate_inverse(sensor, nu[..., :3]), nu[..., 3:]], dim=-1)

    def sense(self, sensed: Sensed) -> Sensed:
        """Report the velocity along the sensor's own axes."""
        rate = None if sensed.nu_dot is None else self._turned(sensed.nu_dot)
        return replace(sensed, nu=self._turned(sensed.nu), nu_dot=rate)
