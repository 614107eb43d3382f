"""Quadratic damping that differs from the nominal one."""

from __future__ import annotations

from auvnn.effects.base import Body, Moment, axis_scale
from auvnn.effects.factors import AxisFactors


class QuadraticDamping(AxisFactors):
    """Factors on the quadratic damping, of the matrix and of displaced elements along their own axes.

    D <- S D S with S = diag(sqrt(f)). Reference: Fossen (2011), section 6.4.
    """

    name = "quadratic_damping"
    cause = "the quadratic damping is not the nominal one"
    symbol = "D_Q"
    reference = "Fossen (2011), section 6.4"

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Scale the quadratic damping."""
        if body.quadratic is not None:
            body = body.but(quadratic=body.quadratic * axis_scale(self.theta).to(body.quadratic))
        if body.element_quadratic is not None:
            body = body.but(element_quadratic=body.element_quadratic * self.theta.to(body.element_quadratic))
        return body
