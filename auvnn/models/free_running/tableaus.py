"""Explicit Runge-Kutta schemes by which models run freely."""

from __future__ import annotations

# Explicit schemes whose stages each need the one before only: (stage times, weights).
TABLEAUS = {
    "rk4": ((0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    "midpoint": ((0.0, 0.5), (0.0, 1.0)),
    "euler": ((0.0,), (1.0,)),
}
