"""Drag that acts across degrees of freedom: a moment from sway, a force from yaw."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import translational_drag

SPEEDS = "uvwpqr"
NAMES = ("Yr", "Nv", "Zq", "Mw", "Kv", "Mu", "Xq", "Yp")
"""A force or moment and the velocity that causes it: what a centre of pressure off the origin makes."""


class CoupledDamping(Effect):
    """Off-diagonal quadratic drag, with SNAME's sign: `Nv` is N_v|v|, a moment N = Nv v |v|.

    tau_i <- tau_i + sum_j theta_ij nu_j |nu_j|, that is D_Q[i][j] <- D_Q[i][j] - theta_ij, in the relative
    velocity. Drag at x aft of the origin (x < 0) gives Nv = -x Y_drag > 0: the stern trails.
    Reference: Fossen (2011), section 6.4; Prestero (2001) for N_v|v|, Y_r|r|, M_w|w| and Z_q|q|.
    """

    name = "coupled_damping"
    cause = "drag in one degree of freedom acts in another"
    symbol = "D_ij"
    reference = "Fossen (2011), section 6.4; Prestero (2001)"
    confused_with = ("body_lift", "cross_flow_drag", "cg_offset")
    manoeuvre = "oblique"
    told_apart_by = "steady motion at 0, 30, 60 and 90 degrees of drift"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the coefficients; plausible is drag that acts a twentieth of the length off the origin."""
        drag, length = translational_drag(vehicle), float(vehicle.length)
        out = []
        for name in NAMES:
            turning = name[0] in "XYZ"
            along = AXES.index(name[0]) if turning else SPEEDS.index(name[1])
            scale = 0.05 * float(drag[along]) * (length**2 if turning else length)
            unit = "N s2" if turning else "N s2/m"
            out.append(Parameter(name, unit, 0.0, scale, -200 * scale, 200 * scale))
        return tuple(out)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep where each coefficient stands in the matrix."""
        place = np.zeros((len(NAMES), 6, 6))
        for k, name in enumerate(NAMES):
            place[k, AXES.index(name[0]), SPEEDS.index(name[1])] = -1.0
        self.keep("place", place)

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add to the quadratic damping, of which there may have been none."""
        more: Tensor = torch.tensordot(self.theta, self.kept("place"), dims=1).to(body.added_mass)
        return body.but(quadratic=more if body.quadratic is None else body.quadratic + more)
