"""Thrusters whose thrust grows with other powers of the command, ahead and astern."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.factors import actuators
from auvnn.effects.full_command import FullCommandEffect
from auvnn.effects.hooks import Parameter

# Below this share of full command the two curves differ by a factor, so that the slope at zero is finite.
LEAST = 1e-3


class ThrustCurve(FullCommandEffect):
    """Two exponents per thruster: c_i <- sign(c_i) |c_i|^m_i, m_i by the sign of c_i, before the thruster's own curve.

    A quadratic curve becomes T = T_full |c|^(2 m). Full command stays full command, which is what tells it from
    `thruster_gain`; small commands still give some thrust, which is what tells it from a dead band. A commanded
    wrench is taken as a share of the full effort in each degree of freedom. Motors whose speed falls short of the
    command under load have m < 1: of the T200 the table of 2019 is met by m of 0.78 to 0.91, depending on voltage and
    direction, to 0.9 % of full thrust (rms), by a dead band instead to 1.7 %. Its slope at the null is c ln|c|.
    Reference: Blue Robotics (2019), T200 data; Carlton (2012), Marine Propellers and Propulsion, chapter 6.
    """

    name = "thrust_curve"
    cause = "the thrust grows with another power of the command than stated"
    symbol = "m_T"
    reference = "Blue Robotics (2019), T200 data"
    confused_with = ("thruster_gain", "thruster_deadband", "thrust_asymmetry", "constant_force")
    manoeuvre = "pulses"
    told_apart_by = "short pushes from rest with each thruster, weak, of half strength and hard"
    plainer = ("thruster_gain",)
    leaves = ("constant_force", "net_buoyancy")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return two exponents per actuator, of positive and of negative commands."""
        return tuple(
            Parameter(f"{name}_{side}", "1", 1.0, 0.2, 0.3, 3.0, actuator=i)
            for side in ("positive", "negative")
            for i, name in enumerate(actuators(vehicle, actuation))
        )

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Take each command to its power; unchanged, exactly, at exponents of one."""
        size = torch.clamp(self.share(command).abs(), min=LEAST)
        positive, negative = (self.theta.to(command) - 1.0).chunk(2)
        more = torch.where(command > 0.0, positive, negative)
        return command + command * torch.expm1(more * torch.log(size))
