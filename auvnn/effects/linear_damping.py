"""Linear damping that differs from the nominal one."""

from __future__ import annotations

from auvnn.effects.factors import DampingFactors


class LinearDamping(DampingFactors):
    """Factors on the linear damping, of the matrix and of displaced elements along their own axes.

    D <- S D S with S = diag(sqrt(f)). Reference: Fossen (2011), section 6.4.
    """

    name = "linear_damping"
    cause = "the linear damping is not the nominal one"
    symbol = "D_L"
    reference = "Fossen (2011), section 6.4"
    damping = "linear"
