"""From a wanted wrench to thruster commands: pseudo-inverse of the geometry, inverse of the curves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.vehicle import ThrustTable, Vehicle

Array = NDArray[np.float64]

# A direction of which the thrusters reach less than this share counts as out of reach.
REACH = 0.2


class Allocation:
    """What the thrusters of a vehicle can do.

    Args:
        vehicle: with at least one thruster.

    Attributes:
        matrix: B with tau = B T, (6, n).
        inverse: its pseudo-inverse, moments weighed by the vehicle's length, (n, 6).
        limits: largest wrench along each degree of freedom alone, N and N m, (6,); zero out of reach.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Invert the geometry and the curves."""
        units = vehicle.thrusters
        directions = np.array([u.direction for u in units])
        moments = np.cross(np.array([u.position for u in units]), directions)
        self.matrix: Array = np.concatenate([directions, moments], axis=1).T
        # Newtons and newton metres must not be weighed alike: a metre means little to a small vehicle.
        weight = np.array([1.0] * 3 + [1.0 / vehicle.length] * 3)
        inverse = np.linalg.pinv(weight[:, None] * self.matrix, rcond=1e-9)
        self.inverse: Array = (inverse * weight).astype(np.float64)
        self._curves = [_inverse_curve(u.curve, u.max_forward, u.max_reverse) for u in units]
        self.low: Array = np.array([thrust[0] for thrust, _ in self._curves])
        self.high: Array = np.array([thrust[-1] for thrust, _ in self._curves])
        self.limits: Array = self._limits()

    def _limits(self) -> Array:
        limits = np.zeros(6)
        for axis in range(6):
            thrust = self.inverse[:, axis]
            if (self.matrix @ thrust)[axis] < REACH:
                continue
            limits[axis] = min(self._scale(thrust), self._scale(-thrust))
        return limits

    def _scale(self, thrust: Array) -> float:
        """Return by how much a pattern of thrusts may grow before the first thruster is at its limit."""
        size = np.maximum(thrust, 0) / np.maximum(self.high, 1e-12)
        size += np.maximum(-thrust, 0) / np.maximum(-self.low, 1e-12)
        return float(1.0 / size.max()) if size.max() > 1e-9 else 0.0

    def thrust(self, wrench: Array) -> Array:
        """Return the thrusts of least norm that come nearest to a wrench (..., 6), N, (..., n), unlimited."""
        return wrench @ self.inverse.T

    def command(self, thrust: Array) -> Array:
        """Return the commands that give the thrusts (..., n), N, as far as the thrusters reach."""
        columns = [np.interp(thrust[..., i], *curve) for i, curve in enumerate(self._curves)]
        return np.stack(columns, axis=-1)


def _inverse_curve(curve: str | ThrustTable, forward: float, reverse: float) -> tuple[Array, Array]:
    """Return thrust and command, both rising, dense enough to be read backwards."""
    if isinstance(curve, ThrustTable):
        low, high = int(np.argmin(curve.thrust)), int(np.argmax(curve.thrust))
        command, thrust = curve.command[low : high + 1], curve.thrust[low : high + 1]
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(thrust)) > 0])
        return thrust[rising], command[rising]
    # Evenly spaced in the command, so that the steep inverse about zero is kept.
    command = np.linspace(-1.0, 1.0, 4001)
    thrust = np.where(command > 0, forward, reverse) * command * np.abs(command)
    return thrust, command
