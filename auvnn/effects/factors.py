"""What the effects that scale a group of coefficients share: one factor per degree of freedom."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter


def actuators(vehicle: Any, actuation: str) -> tuple[str, ...]:
    """Return the names of the actuators: thrusters, or the axes of a commanded wrench."""
    if actuation == "wrench":
        return AXES
    return tuple(f"thruster_{i + 1}" for i in range(len(vehicle.thrusters)))


def axis_scale(factors: Tensor) -> Tensor:
    """Return the 6x6 pattern sqrt(f_i f_j): scales a diagonal by f and keeps a matrix positive definite.

    Clipped at a tiny positive number so that the slope stays finite at the bound.
    """
    root = torch.sqrt(torch.clamp(factors, min=1e-12))
    return root.unsqueeze(-1) * root.unsqueeze(-2)


class AxisFactors(Effect):
    """Six factors on the diagonal of a coefficient matrix; one everywhere changes nothing.

    Off-diagonal entries (i, j) follow by sqrt(f_i f_j), which keeps a symmetric matrix positive definite.
    """

    scales = True

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one factor per degree of freedom."""
        return tuple(Parameter(axis, "1", 1.0, 1.0, 0.01, 20.0) for axis in AXES)


class DampingFactors(AxisFactors):
    """Factors on one kind of damping, of the matrix and of displaced elements along their own axes.

    D <- S D S with S = diag(sqrt(f)).
    """

    damping: ClassVar[
        str
    ]  # the field of `Body` that holds the matrix; `element_` before it, that of the elements

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Scale the damping."""
        elements = f"element_{self.damping}"
        for field, factor in ((self.damping, axis_scale(self.theta)), (elements, self.theta)):
            nominal = getattr(body, field)
            if nominal is not None:
                body = body.but(**{field: nominal * factor.to(nominal)})
        return body
