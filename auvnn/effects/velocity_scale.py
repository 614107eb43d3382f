"""A velocity sensor that reads too much or too little."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed


class VelocityScale(Effect):
    """Reported translational velocity: factor times the true one, and so its derivative.

    A wrong speed of sound in an acoustic log does this. Positions, from another sensor, stay what they are.
    Reference: Hegrenaes and Hallingstad (2011), IEEE JOE 36(2).
    """

    name = "velocity_scale"
    cause = "the velocity sensor reads too much or too little"
    symbol = "k_v"
    reference = "Hegrenaes and Hallingstad (2011), IEEE JOE 36(2)"
    confused_with = ("linear_damping", "quadratic_damping", "thruster_gain")
    manoeuvre = "reciprocal"
    told_apart_by = "straight legs with an independent position fix"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factor."""
        return (Parameter("factor", "1", 1.0, 0.03, 0.3, 3.0),)

    def _scaled(self, nu: Tensor) -> Tensor:
        return torch.cat([nu[..., :3] * self.theta[0].to(nu), nu[..., 3:]], dim=-1)

    def sense(self, sensed: Sensed) -> Sensed:
        """Scale the velocity."""
        rate = None if sensed.nu_dot is None else self._scaled(sensed.nu_dot)
        return replace(sensed, nu=self._scaled(sensed.nu), nu_dot=rate)
