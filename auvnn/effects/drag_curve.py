"""Drag that grows with another power of the speed than the second."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.effects.base import AXES, Body, Effect, Moment, Parameter
from auvnn.effects.sizes import usual_speeds
from auvnn.physics.drag import element_transform
from auvnn.physics.products import matvec


class DragCurve(Effect):
    """Exponents of the quadratic damping: D_Q |nu_j| nu_j <- D_Q v0_j^(2 - n_j) |nu_j|^(n_j - 1) nu_j.

    The two laws agree at v0 = 0.16 sqrt(g L), for turning 0.128 sqrt(g / L), so that an exponent changes the form and not
    the amount. Friction grows with an exponent of about 1.8, forms near their drag crisis with less than two.
    Reference: Hoerner (1965), Fluid-Dynamic Drag, chapter 2; Fossen (2011), section 6.4.
    """

    name = "drag_curve"
    cause = "the drag grows with another power of the speed"
    symbol = "n"
    reference = "Hoerner (1965), Fluid-Dynamic Drag, chapter 2"
    confused_with = ("quadratic_damping", "linear_damping", "unstated_damping", "thrust_inflow_loss")
    manoeuvre = "coast_down"
    told_apart_by = "coasting without thrust over at least four to one in speed"
    plainer = ("quadratic_damping", "linear_damping", "unstated_damping")
    is_drag = True

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model file must state: quadratic damping."""
        stated = vehicle.quadratic_damping is not None or vehicle.damping_elements
        return () if stated else ("quadratic_damping",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one exponent per degree of freedom."""
        return tuple(Parameter(axis, "1", 2.0, 0.3, 1.0, 3.5) for axis in AXES)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the speeds at which the laws agree, and where parts with separate drag are."""
        self.keep("speed", usual_speeds(vehicle))
        self.parts = len(vehicle.damping_elements)
        if self.parts:
            place, axes = (
                torch.tensor(np.array([getattr(e, n) for e in vehicle.damping_elements]))
                for n in ("position", "axes")
            )
            self.keep("to_parts", element_transform(place, axes).numpy())

    def _more(self, speed: Tensor) -> Tensor:
        """Return what the other power has more than |x| x; nothing, exactly, at an exponent of two."""
        ratio = torch.clamp(speed.abs() / self.kept("speed").to(speed), min=1e-9)
        return speed.abs() * speed * torch.expm1((self.theta.to(speed) - 2.0) * torch.log(ratio))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the drag by the other power less that by the square."""
        out = torch.zeros_like(moment.nu)
        if body.quadratic is not None:
            out = out - matvec(body.quadratic, self._more(moment.drag_flow))
        if self.parts and body.element_quadratic is not None:
            to_parts = self.kept("to_parts").to(moment.nu)
            own = matvec(to_parts.flatten(0, 1), moment.drag_flow).unflatten(-1, (self.parts, 6))
            force = body.element_quadratic * self._more(own)
            out = out - matvec(to_parts.flatten(0, 1).mT, force.flatten(-2))
        return out
