"""Sideways drag that is spread along the hull."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import translational_drag

STRIPS = 8


class CrossFlowDrag(Effect):
    """Part of the quadratic sway and heave drag acts in strips along the hull instead of at the origin.

    With V_x = v + x r, W_x = w - x q and V_cf = sqrt(V_x^2 + W_x^2) a strip at x has y-force -Y V_cf V_x and
    z-force -Z V_cf W_x per length of the hull, Y and Z being the drag of the whole; what acts at the origin is
    taken off: share times (strips - [0, -Y |v| v, -Z |w| w, 0, 0, 0]). Pure sway and pure heave stay what they
    are; turning and oblique motion do not. Hull from -L/2 to L/2, Y and Z from the model's own drag.
    Reference: Faltinsen (1990), chapter 6; Fossen (2011), section 6.4.
    """

    name = "cross_flow_drag"
    cause = "sideways drag is spread along the hull"
    symbol = "C_d2D"
    reference = "Faltinsen (1990), chapter 6; Fossen (2011), section 6.4"
    confused_with = ("coupled_damping", "quadratic_damping")
    manoeuvre = "oblique"
    told_apart_by = "sideways motion with and without turning"
    plainer = ("quadratic_damping",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the share of the drag that is spread."""
        return (Parameter("share", "1", 0.0, 0.5, -1.0, 5.0),)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the strips (Gauss's points along the hull) and the drag."""
        points, weights = np.polynomial.legendre.leggauss(STRIPS)
        self.keep("strips", 0.5 * float(vehicle.length) * points)
        self.keep("weights", 0.5 * weights)
        self.keep("drag", translational_drag(vehicle))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return strips less centre."""
        nu = moment.drag_flow
        _, v, w, _, q, r = nu.unbind(-1)
        x, weight, drag = (self.kept(n).to(nu) for n in ("strips", "weights", "drag"))
        side = v.unsqueeze(-1) + x * r.unsqueeze(-1)
        sink = w.unsqueeze(-1) - x * q.unsqueeze(-1)
        speed = torch.sqrt(side * side + sink * sink + 1e-30)
        y, z = -drag[1] * speed * side * weight, -drag[2] * speed * sink * weight
        none = torch.zeros_like(v)
        force = [y.sum(-1) + drag[1] * v.abs() * v, z.sum(-1) + drag[2] * w.abs() * w]
        turning = [-(x * z).sum(-1), (x * y).sum(-1)]
        return self.theta[0].to(nu) * torch.stack([none, *force, none, *turning], dim=-1)
