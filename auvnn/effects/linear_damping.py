"""Linear damping that differs from the nominal one."""

from __future__ import annotations

from auvnn.effects.base import Body, Moment, axis_scale
from auvnn.effects.factors import AxisFactors


class LinearDamping(AxisFactors):
    """Factors on the linear damping, of the matrix and of displaced elements along their own axes.

    D <- S D S with S = diag(sqrt(f)). Reference: Fossen (2011), section 6.4.
    """

    name = "linear_damping"
    cause = "the linear damping is not the nominal one"
    symbol = "D_L"
    reference = "Fossen (2011), section 6.4"

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Scale the linear damping."""
        if body.linear is not None:
            body = body.but(linear=body.linear * axis_scale(self.theta).to(body.linear))
        if body.element_linear is not None:
            body = body.but(element_linear=body.element_linear * self.theta.to(body.element_linear))
        return body
