"""Accelerations from an accelerometer that is mounted askew."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed
from auvnn.physics.attitude import euler_to_quat, quat_rotate_inverse


class AccelerometerTilt(Effect):
    """Reported accelerations were worked out from specific force measured along tilted axes.

    f = v_dot + omega x v - R'g, of which the tilted sensor reads R_s' f; undone with the true attitude this
    gives v_dot' = R_s' f - omega x v + R'g, an error of g times the tilt: 0.17 m/s2 per degree.
    Reference: Fossen (2011), section 11.5; Titterton and Weston (2004), chapter 12.
    """

    name = "accelerometer_tilt"
    cause = "the accelerometer is mounted askew"
    symbol = "R_a"
    reference = "Fossen (2011), section 11.5; Titterton and Weston (2004), chapter 12"
    confused_with = ("constant_force", "cg_offset")
    manoeuvre = "rotation"
    told_apart_by = "static angles of roll and pitch"
    channels = ("du", "dv", "dw")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the tilt; half a degree is plausible."""
        return tuple(Parameter(n, "rad", 0.0, 0.01, -0.8, 0.8) for n in ("roll", "pitch"))

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep gravity."""
        self.keep("gravity", [0.0, 0.0, float(vehicle.gravity)])

    def sense(self, sensed: Sensed) -> Sensed:
        """Add what the tilt does to the accelerations, where there are any."""
        if sensed.nu_dot is None:
            return sensed
        roll, pitch = self.theta.to(sensed.nu).unbind(-1)
        sensor = euler_to_quat(torch.stack([roll, pitch, torch.zeros_like(roll)], dim=-1))
        v, omega = sensed.nu[..., :3], sensed.nu[..., 3:]
        down = self.kept("gravity").to(sensed.nu).expand_as(v)
        specific = sensed.nu_dot[..., :3] + torch.linalg.cross(omega, v)
        specific = specific - quat_rotate_inverse(sensed.quaternion, down)
        error: Tensor = quat_rotate_inverse(sensor, specific) - specific
        return replace(sensed, nu_dot=sensed.nu_dot + torch.nn.functional.pad(error, (0, 3)))
