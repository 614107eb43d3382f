"""Quadratic damping that differs from the nominal one."""

from __future__ import annotations

from auvnn.effects.factors import DampingFactors


class QuadraticDamping(DampingFactors):
    """Factors on the quadratic damping, of the matrix and of displaced elements along their own axes.

    D <- S D S with S = diag(sqrt(f)). Reference: Fossen (2011), section 6.4.
    """

    name = "quadratic_damping"
    cause = "the quadratic damping is not the nominal one"
    symbol = "D_Q"
    reference = "Fossen (2011), section 6.4"
    damping = "quadratic"
