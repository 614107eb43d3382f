"""Thrusters whose curve is off by a smooth function of the command, a polynomial."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.factors import actuators
from auvnn.effects.full_command import FullCommandEffect
from auvnn.effects.hooks import Parameter

# Of the highest Legendre polynomial.
DEGREE = 4


class ThrustPolynomial(FullCommandEffect):
    """Four coefficients per thruster: c_i <- c_i (1 + sum_k a_ik P_k(c_i)), k = 1 to 4, before the thruster's own curve.

    P_k are the Legendre polynomials; the one of degree 0 is missing, a command that is off by the same share
    everywhere: that is `thruster_gain`. A quadratic curve becomes T (1 + sum a P)^2. Odd degrees tell ahead from astern,
    as `thrust_asymmetry` does by a jump, even ones small commands from large ones, as `thrust_curve` does by a power:
    this is what is left to say where no such form fits, as of a curve measured at a few commands or on another unit. Of
    the T200 the table of 2019 is met to 0.8 % of full thrust (rms, with a gain), by `thrust_curve` as well, by a gain
    alone to 3.9 %. A commanded wrench is taken as a share of the full effort in each degree of freedom; beyond the
    full one the share is that of the full one.
    Reference: Blue Robotics (2019), T200 data; Carlton (2012), Marine Propellers and Propulsion, chapter 6.
    """

    name = "thrust_polynomial"
    cause = "the thrust curve is off by a smooth function of the command"
    symbol = "a_P"
    reference = "Blue Robotics (2019), T200 data"
    confused_with = (
        "thruster_gain",
        "thrust_asymmetry",
        "thrust_curve",
        "thruster_deadband",
        "constant_force",
    )
    manoeuvre = "pulses"
    told_apart_by = "short pushes from rest with each thruster, of many strengths, ahead and astern"
    plainer = ("thruster_gain", "thrust_asymmetry", "thrust_curve", "thruster_deadband")
    leaves = ("constant_force", "net_buoyancy")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return a coefficient per degree and actuator."""
        return tuple(
            Parameter(f"{name}_degree_{k}", "1", 0.0, 0.05, -0.25, 0.25, actuator=i)
            for k in range(1, DEGREE + 1)
            for i, name in enumerate(actuators(vehicle, actuation))
        )

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Change each command by its polynomial; unchanged, exactly, at coefficients of zero."""
        c = torch.clamp(self.share(command), min=-1.0, max=1.0)
        square = c * c
        first, second, third, fourth = self.theta.to(command).chunk(DEGREE)
        odd = c * (first + third * (2.5 * square - 1.5))
        even = second * (1.5 * square - 0.5) + fourth * ((4.375 * square - 3.75) * square + 0.375)
        return command + command * (odd + even)
