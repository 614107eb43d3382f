"""Thrust that falls with the advance ratio of the propeller, and not below a share of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import Effect, Extent, Moment, Parameter
from auvnn.effects.sizes import full_wrench, usual_speeds


class ThrustAdvance(Effect):
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

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the actuators' geometry and what a full command is."""
        if actuation == "wrench":
            columns, full = np.diag([1.0, 1, 1, 0, 0, 0]), full_wrench(vehicle)
        else:
            columns = np.array(
                [[*u.direction, *np.cross(u.position, u.direction)] for u in vehicle.thrusters]
            )
            full = np.ones(len(columns))
        self.keep("columns", columns)
        self.keep("full", full)

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Take the loss off."""
        inflow = moment.nu_r @ self.kept("columns").to(thrust).mT
        share = moment.command.to(thrust) / self.kept("full").to(thrust)
        loss, speed = self.theta.to(thrust).unbind(-1)
        # J / (1 + |J|) without dividing by a command that may be nought.
        ratio = inflow * torch.sign(share) / (share.abs() * speed + inflow.abs() + 1e-9 * speed)
        return thrust * (1.0 - loss * ratio)
