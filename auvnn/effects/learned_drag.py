"""What learned damping may be wrong by."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.physics.products import matvec

SPEEDS = "uvwpqr"


class LearnedDrag(Effect):
    """A correction of drag, linear and quadratic in the velocities through the water, with every coupling.

    tau_i <- tau_i - sum_j a_ij nu_j - sum_jk b_ikj |nu_k| nu_j, all of the velocity through the water. Drag at a
    centre of its own, such as |v + x r| (v + x r), is close to such a sum. It stands for what a diagnosis cannot
    know of damping that was learned: it is uncertain together with what else is, and as a separate cause it names
    nothing, so the catalogue does not offer it. Reference: Fossen (2011), section 6.4.
    """

    name = "learned_drag"
    cause = "learned damping is off"
    symbol = "d"
    reference = "Fossen (2011), section 6.4"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return 42 coefficients for each axis: of nu_j, then of |nu_k| nu_j, j fastest."""
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        out = []
        for axis in AXES:
            unit, size = ("N", force) if axis in "XYZ" else ("N m", 0.1 * force * float(vehicle.length))
            for name in (*SPEEDS, *(f"abs{k}_{j}" for k in SPEEDS for j in SPEEDS)):
                per = "".join("/(m/s)" if s in "uvw" else "/(rad/s)" for s in name if s in SPEEDS)
                out.append(Parameter(f"{axis}_{name}", f"{unit}{per}", 0.0, size, -1e6, 1e6))
        return tuple(out)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the force and moment of the corrections."""
        return -matvec(self.theta.to(moment.nu_r).unflatten(-1, (6, 42)), products(moment.drag_flow))


def products(nu: Tensor) -> Tensor:
    """Return nu_j and |nu_k| nu_j, j fastest, of velocities (..., 6): (..., 42)."""
    return torch.cat([nu, (nu.abs().unsqueeze(-1) * nu.unsqueeze(-2)).flatten(-2)], dim=-1)
