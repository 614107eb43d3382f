"""A simple controller: outer loops turn errors into wanted rates, inner ones (PI) into a wrench."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.models import GreyBox
from auvnn.simulation.cruise import fin_slopes
from auvnn.simulation.limits import Limits

Array = NDArray[np.float64]

# Bandwidth of the inner (rate) loops, 1/s; gain of the outer ones, 1/s; gain of the integral, 1/s.
INNER, OUTER, INTEGRAL = 1.5, 0.5, 0.4
# Largest turn rate, rad/s, and climb rate, m/s, asked for; return to level, 1/s.
TURN, CLIMB, LEVEL = 0.35, 0.2, 1.0
# Steering by fins: a slender hull turns itself broadside, so the loops are faster and the rates smaller;
# rad of pitch per metre of depth error, largest pitch, rad, and slowest speed reckoned with, m/s.
FIN_INNER, FIN_TURN = 5.0, 0.06
DIVE, DIVE_PITCH, SLOWEST = 0.12, 0.15, 0.5


@dataclass(frozen=True)
class SetPoints:
    """What the vehicle is to do, (R, T) each: heading, rad, forward speed, m/s, depth, m."""

    heading: Array
    speed: Array
    depth: Array

    def to_dict(self) -> dict[str, Array]:
        """Return the set points by name."""
        return {"heading": self.heading, "speed": self.speed, "depth": self.depth}


class Autopilot:
    """Holds heading, speed and depth of all runs at once, from what is measured.

    Each degree of freedom i that the thrusters reach gets tau_i = M_ii (k e_i + k_I int e_i dt), where e_i is
    the difference between a wanted and the measured rate: surge to the speed set, sway to zero, heave to a
    climb rate and yaw to a turn rate in proportion to the errors of depth and heading. Roll and pitch are
    held level as far as the thrusters reach them and left to the restoring moment otherwise. A vehicle that
    is steered by fins dives by pitching, its fins take the moments, and its speed is set by thrust alone.

    Args:
        model: with which the gains are chosen.
        limits: of its vehicle.
        points: what to do.
        step: time between two rows, s.
    """

    def __init__(self, model: GreyBox, limits: Limits, points: SetPoints, step: float) -> None:
        """Choose the gains."""
        vehicle = model.vehicle
        self.limits, self.points, self.step = limits, points, step
        # A sampled loop must stay slower than its samples.
        fastest = 0.5 / step
        self.gain = min(INNER, fastest) * np.diagonal(vehicle.inertia_matrix)
        self.turn = TURN
        self.range = limits.range.copy()
        self.integral = np.zeros((points.heading.shape[0], 6))
        self.steering: Array | None = None
        if limits.steady is not None:
            self.gain[3:] = min(FIN_INNER, fastest) * np.diagonal(vehicle.inertia_matrix)[3:]
            self.turn = FIN_TURN
            slopes = fin_slopes(vehicle)[3:]
            self.steering = np.linalg.pinv(slopes, rcond=1e-3).astype(np.float64)
            self.range[3:] = np.abs(slopes) @ limits.angle * limits.steady.nu[0] ** 2
            self.cruising = limits.mean * limits.wrench[0]
            self.most = limits.angle + np.abs(limits.steady.fins)

    def __call__(self, k: int, position: Array, quaternion: Array, nu: Array) -> tuple[Array, Array | None]:
        """Return commands (R, n) and fin angles (R, m), held from row k on."""
        w, x, y, z = quaternion.T
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
        # Third row of the rotation from body to world.
        down = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
        sinking = (down * nu[:, :3]).sum(axis=1)
        roll = np.arctan2(down[:, 1], down[:, 2])
        turn = (self.points.heading[:, k] - yaw + np.pi) % (2 * np.pi) - np.pi
        deeper = self.points.depth[:, k] - position[:, 2]
        error = -nu
        error[:, 0] += self.points.speed[:, k]
        error[:, 2] = np.clip(OUTER * deeper, -CLIMB, CLIMB) - sinking
        error[:, 3] -= LEVEL * roll
        wanted = 0.0 if self.steering is None else np.clip(-DIVE * deeper, -DIVE_PITCH, DIVE_PITCH)
        error[:, 4] += np.clip(LEVEL * (wanted - pitch), -self.turn, self.turn)
        error[:, 5] += np.clip(OUTER * turn, -self.turn, self.turn)
        self.integral += INTEGRAL * self.step * self.gain * error
        self.integral = np.clip(self.integral, -self.range, self.range)
        wrench = np.clip(self.gain * error + self.integral, -self.range, self.range)
        fins = np.zeros((len(nu), self.limits.fins)) if self.limits.fins else None
        if self.steering is not None and self.limits.steady is not None:
            speed = np.maximum(np.abs(nu[:, :1]), SLOWEST)
            fins = np.clip(wrench[:, 3:] @ self.steering.T / speed**2, -self.most, self.most)
            wrench[:] = 0.0
            # Set by thrust, not by the speed over ground: against a current there may not be enough of it,
            # and with one, or in reverse, the fins would lose their hold on the water.
            wrench[:, 0] = self.cruising * (self.points.speed[:, k] / self.limits.steady.nu[0]) ** 2
        if self.limits.allocation is None:
            return self.limits.trim + wrench, fins
        thrust = self.limits.allocation.thrust(self.limits.trim + wrench)
        return self.limits.allocation.command(thrust), fins
