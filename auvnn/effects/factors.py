"""What the effects that scale a group of coefficients share: one factor per degree of freedom."""

from __future__ import annotations

from typing import Any

from auvnn.effects.base import AXES, Effect, Parameter


class AxisFactors(Effect):
    """Six factors on the diagonal of a coefficient matrix; one everywhere changes nothing.

    Off-diagonal entries (i, j) follow by sqrt(f_i f_j), which keeps a symmetric matrix positive definite.
    """

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one factor per degree of freedom."""
        return tuple(Parameter(axis, "1", 1.0, 1.0, 0.01, 20.0) for axis in AXES)
