"""Thrusters that give nothing for small commands."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.full_command import FullCommandEffect
from auvnn.effects.hooks import EACH, Parameter


class ThrusterDeadband(FullCommandEffect):
    """No thrust for commands within the dead band; beyond it the command counts from the band's edge.

    c <- sign(c) (|c| - width)+ / (1 - width), so that full command stays full command; beyond it c stays as
    it is. A commanded wrench is taken as a share of the full effort in each degree of freedom. The width is a
    share of full command. Its slope at the null is that of the edge, -sign(c) (1 - |c|), and so does not vanish.
    Reference: Bessa, Dutra and Kreuzer (2013) for the dead zone of thrusters; Blue Robotics (2019), T200 data.
    """

    name = "thruster_deadband"
    cause = "small commands give no thrust"
    symbol = "delta_T"
    reference = "Bessa, Dutra and Kreuzer (2013), J. Brazilian Soc. Mech. Sci. 35"
    confused_with = ("thruster_gain", "thruster_lag")
    manoeuvre = "pulses"
    told_apart_by = "small and large pushes from rest"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return half the width of the band, as a share of full command."""
        return (Parameter("width", "1", 0.0, 0.07, 0.0, 0.6, actuator=EACH),)

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Take the band out of the commands."""
        full, width = self.kept("full").to(command), self.theta[0].to(command)
        size = self.share(command).abs()
        inside = torch.clamp(size - width, min=0.0) / (1.0 - width)
        return command.sign() * full * torch.where(size < 1.0, inside, size)
