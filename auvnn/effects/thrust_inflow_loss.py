"""Thrust that falls when the water comes towards the propeller."""

from __future__ import annotations

from typing import Any

import numpy as np
from torch import Tensor

from auvnn.effects.hooks import Moment, Parameter
from auvnn.effects.inflow import InflowEffect
from auvnn.effects.sizes import full_wrench


class ThrustInflowLoss(InflowEffect):
    """Loss by inflow: T_i <- T_i - k |c_i| V_i, V_i = d_i . (v_r + omega x r_i) = b_i . nu_r.

    From T = rho D^4 [K_0 n |n| - c |n| V_a / D] with revolutions n in proportion to the command c. It vanishes
    at the bollard and when the propeller stands still, which is what tells it from drag. A commanded wrench
    loses along x, y and z alone, c being its share of the full effort.
    Reference: Fossen (2011), section 9.1 and 12.3; Carlton (2012) for K_T(J).
    """

    name = "thrust_inflow_loss"
    cause = "thrust falls with the speed of the inflow"
    symbol = "k_V"
    reference = "Fossen (2011), section 9.1"
    confused_with = ("linear_damping", "quadratic_damping", "thruster_gain")
    manoeuvre = "coast_down"
    told_apart_by = "coasting, pushes from rest, and steady speed with several throttles"
    plainer = ("thruster_gain",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the loss per speed at full command; a third of full thrust at 1 m/s is plausible."""
        if actuation == "wrench":
            full = float(full_wrench(vehicle)[:3].mean())
        else:
            full = float(np.mean([max(u.max_forward, u.max_reverse) for u in vehicle.thrusters]))
        return (Parameter("coefficient", "N s/m", 0.0, 0.3 * full, -5 * full, 20 * full),)

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Take the loss off."""
        share = self.share(moment).to(thrust).abs()
        return thrust - self.theta[0].to(thrust) * share * self.inflow(moment).to(thrust)
