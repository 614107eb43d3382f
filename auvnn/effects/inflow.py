"""What effects of the inflow to the propellers share: where the propellers are, and how fast the water comes."""

from __future__ import annotations

from typing import Any

import numpy as np
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Moment
from auvnn.effects.sizes import full_wrench


class InflowEffect(Effect):
    """An effect of the inflow V_i = d_i . (v_r + omega x r_i) = b_i . nu_r on the thrust of each propeller.

    A commanded wrench is taken as six propellers of which three push, along x, y and z.
    """

    by_speed = True

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

    def inflow(self, moment: Moment) -> Tensor:
        """Return the speed of the water towards each propeller, m/s, (..., n)."""
        return moment.nu_r @ self.kept("columns").to(moment.nu_r).mT

    def share(self, moment: Moment) -> Tensor:
        """Return the speeds of the propellers, as commands, as shares of full ones, (..., n)."""
        return moment.turning / self.kept("full").to(moment.turning)
