"""Where a world departs from the equations that models share: drawn numbers that a plant obeys, data and no more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wander:
    """A wrench in body axes that no equation predicts, linear between evenly spaced knots.

    Attributes:
        spacing: s, between knots; the first is at time zero.
        values: at the knots, N and N m, (R, K, 6).
    """

    spacing: float
    values: Array

    def at(self, t: float) -> Array:
        """Return the wrench of all runs at a time, s, (R, 6)."""
        last = self.values.shape[1] - 1
        place = min(max(t / self.spacing, 0.0), float(last))
        k = min(int(place), max(last - 1, 0))
        part = place - k
        return (1.0 - part) * self.values[:, k] + part * self.values[:, min(k + 1, last)]

    def knots(self, begin: float, end: float) -> list[float]:
        """Return the knots strictly between two times: the slope jumps there."""
        first, last = int(np.floor(begin / self.spacing)), int(np.ceil(end / self.spacing))
        moments = (self.spacing * k for k in range(first, last + 1))
        return [t for t in moments if begin + 1e-9 < t < end - 1e-9]


@dataclass(frozen=True)
class Laws:
    """What is other than usual in a world; every field by default as usual.

    Attributes:
        exponent: of the quadratic drag's law in each degree of freedom, (6,): |nu|^(n-1) nu v0^(2-n) instead of |nu| nu.
        speed: v0, at which both laws agree, m/s and rad/s, (6,).
        thrust: largest error of the thrust curves, as a share.
        phase: of each actuator's error, rad, (n,): thrust times 1 + thrust cos(pi c + phase) for the command c.
        separation: share of the lift that follows another form, between 0 and 1: a fin's stall is gentle,
            a hull's u v is multiplied by cos2 of the angle between flow and axis.
        added_coriolis: share of the Coriolis and centripetal forces of the added mass that acts.
        relative: share of the water's motion that anything but the drag feels: inertia, fins, lift, thrusters.
        wander: a wrench that nothing predicts.
    """

    exponent: Array | None = None
    speed: Array | None = None
    thrust: float = 0.0
    phase: Array | None = None
    separation: float = 0.0
    added_coriolis: float = 1.0
    relative: float = 1.0
    wander: Wander | None = None

    @property
    def usual(self) -> bool:
        """Whether nothing departs."""
        shares = (self.thrust, self.separation, self.added_coriolis, self.relative)
        return self.exponent is None and self.wander is None and shares == (0.0, 0.0, 1.0, 1.0)

    def powers(self, nu: Array) -> Array:
        """Return what quadratic coefficients multiply, (..., 6)."""
        if self.exponent is None or self.speed is None:
            return np.abs(nu) * nu
        return self.speed**2 * np.sign(nu) * (np.abs(nu) / self.speed) ** self.exponent

    def curved(self, thrust: Array, command: Array) -> Array:
        """Return the thrusts (R, n) of curves that are off, at commands (R, n) as shares of the full one."""
        if self.thrust == 0.0 or self.phase is None:
            return thrust
        return thrust * (1.0 + self.thrust * np.cos(np.pi * command + self.phase))


USUAL = Laws()
