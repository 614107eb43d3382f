"""Thrust that falls with the advance ratio of the propeller, and not below a share of it."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Extent, Moment, Parameter
from auvnn.effects.inflow import InflowEffect
from auvnn.effects.sizes import usual_speeds


class ThrustAdvance(InflowEffect):
    """T_i <- T_i (1 - loss J_i / (1 + |J_i|)) with the advance ratio J_i = V_i / (c_i V_1), V_i = b_i . nu_r.

    The thrust coefficient K_T falls with J; here it falls steeply at first and then less, so that a propeller in fast
    inflow at little command keeps the share 1 - loss of its thrust, and one that pushes against the inflow gains. V_1 is
    the inflow at full command where half of the loss is reached. A straight line K_T(J) is `thrust_inflow_loss`, which is
    another law where the thrust curve is not quadratic, and where J is large. A commanded wrench loses along x, y, z.
    Reference: Carlton (2012), Marine Propellers and Propulsion, chapter 6; Healey et al. (1995), IEEE JOE 20(4).
    """

    name = "thrust_advance"
    cause = "thrust falls with the advance ratio of the propeller"
    symbol = "K_T(J)"
    reference = "Carlton (2012), Marine Propellers and Propulsion, chapter 6"
    confused_with = ("thrust_inflow_loss", "quadratic_damping", "thruster_gain")
    manoeuvre = "coast_down"
    told_apart_by = "coasting, pushes from rest, and steady speed with several throttles"
    plainer = ("thruster_gain", "thrust_inflow_loss")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the largest loss and the inflow at which half of it is reached at full command."""
        speed = 4.0 * float(usual_speeds(vehicle)[0])
        return (
            Parameter("loss", "1", 0.0, 0.3, -2.0, 2.0),
            Parameter("speed", "m/s", speed, 0.5 * speed, 0.02 * speed, 20.0 * speed, shape=True),
        )

    @classmethod
    def starts(cls, parameters: tuple[Parameter, ...], extent: Extent) -> list[dict[str, float]]:
        """Return a propeller of little pitch and one of much."""
        speed = parameters[1].null
        return [{"speed": 0.5 * speed}, {"speed": 2.0 * speed}]

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Take the loss off."""
        inflow, share = self.inflow(moment).to(thrust), self.share(moment).to(thrust)
        loss, speed = self.theta.to(thrust).unbind(-1)
        # J / (1 + |J|) without dividing by a command that may be zero.
        ratio = inflow * torch.sign(share) / (share.abs() * speed + inflow.abs() + 1e-9 * speed)
        return thrust * (1.0 - loss * ratio)
