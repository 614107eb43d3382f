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
    confused_with = ("linear_damping", "thruster_gain", "thrust_inflow_loss")
    manoeuvre = "coast_down"
    told_apart_by = "coasting without thrust over at least four to one in speed"
    damping = "quadratic"
