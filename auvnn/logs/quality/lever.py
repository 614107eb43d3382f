"""Where a sensor sits, from its own signals: a velocity sensor or an accelerometer away from the body origin.

A velocity sensor at r from the origin reads v + omega x r. Against the derivative of the position, which belongs to
the origin, r follows by least squares, with the sensor's latency, since turning late looks much the same. An
accelerometer that was not carried over to the origin reads omega_dot x r + omega x (omega x r) too much, against the
derivative of the velocity. Reference: Fossen (2011), section 7.5; Kinsey and Whitcomb (2007) for Doppler sensors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from auvnn.logs.quality import kinematics
from auvnn.logs.quality.kinematic_pairs import half_width
from auvnn.logs.signals.derivatives import LocalPolynomial

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

Array = NDArray[np.float64]

CLEAR = 5.0  # standard errors of one component
SMALLEST = 0.03  # m: nearer to the origin it hardly matters
_BLOCK_SECONDS = 5.0
_MIN_BLOCKS = 6
_SHARE = 0.02  # of the variance that the sensors disagree by must be explained
_LONG = 60_000
_TURNS = 0.05  # rad/s: with less rotation there is nothing to tell


@dataclass(frozen=True)
class Lever:
    """Where a sensor sits.

    Args:
        sensor: "velocity" or "acceleration".
        place: x, y, z from the body origin, m, (3,).
        half: half width of the 95 % interval of each, m, (3,).
        clear: whether it is away from the origin beyond doubt.
    """

    sensor: str
    place: Array
    half: Array
    clear: bool

    @property
    def words(self) -> str:
        """The place with its interval."""
        parts = (f"{a} {v:+.3f} +- {h:.3f}" for a, v, h in zip("xyz", self.place, self.half, strict=True))
        return ", ".join(parts) + " m"


def check_lever_arms(log: Log) -> list[Lever]:
    """Return the places of the velocity sensor and of the accelerometer, those that the log can tell."""
    found = []
    for sensor, rows_of in (("velocity", _velocity), ("acceleration", _acceleration)):
        parts = [part for run in log.runs if run.samples <= _LONG and (part := rows_of(run)) is not None]
        if parts and (lever := _solve(sensor, parts)) is not None:
            found.append(lever)
    return found


def cannot_tell(log: Log) -> bool:
    """Say whether the vehicle turns enough for a lever arm to matter and has no position to find it by."""
    rates = np.concatenate([run.nu[:, 3:] for run in log.runs])
    rates = rates[np.isfinite(rates).all(axis=1)]
    turns = float(np.sqrt((rates**2).mean())) if len(rates) else 0.0
    return turns > _TURNS and all(run.position is None for run in log.runs)


def _velocity(run: Run) -> tuple[Array, Array, Array, float] | None:
    pair = kinematics.velocities(run)
    if pair is None:
        return None
    omega = LocalPolynomial(run.t, half_width(run.dt))(run.nu[:, 3:])[0]
    late = LocalPolynomial(run.t, half_width(run.dt))(run.nu[:, :3])[1]
    gap = pair.measured - pair.derived
    return gap, _cross(omega), late, run.dt


def _acceleration(run: Run) -> tuple[Array, Array, Array, float] | None:
    if run.nu_dot is None or not np.isfinite(run.nu_dot[:, :3]).any():
        return None
    smoother = LocalPolynomial(run.t, half_width(run.dt))
    slope = smoother(run.nu)[1][:, :3]
    # The integral of the acceleration passes the same filter as the velocity: smoothing makes no difference.
    steps = 0.5 * np.diff(run.t)[:, None] * (run.nu_dot[1:, :3] + run.nu_dot[:-1, :3])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(np.nan_to_num(steps), axis=0)])
    total = np.where(np.isfinite(run.nu_dot[:, :3]), total, np.nan)
    measured = smoother(total)[1]
    omega, faster = smoother(run.nu[:, 3:])
    arm = _cross(faster) + np.einsum("nij,njk->nik", _cross(omega), _cross(omega))
    return measured - slope, arm, smoother(measured)[1], run.dt


def _cross(omega: Array) -> Array:
    """Return the matrices S with S r = omega x r, (N, 3, 3)."""
    p, q, r = omega.T
    zero = np.zeros_like(p)
    return np.stack(
        [np.stack([zero, -r, q], -1), np.stack([r, zero, -p], -1), np.stack([-q, p, zero], -1)], axis=-2
    )


def _solve(sensor: str, parts: list[tuple[Array, Array, Array, float]]) -> Lever | None:
    """Fit gap = S r + late tau + constant by least squares, outliers weighed down, errors from blocks of time."""
    rows, wanted, block, start = [], [], [], 0
    for gap, arm, late, dt in parts:
        good = np.isfinite(gap).all(1) & np.isfinite(arm).all((1, 2)) & np.isfinite(late).all(1)
        if good.sum() < 50:
            continue
        size = max(int(_BLOCK_SECONDS / dt), 1)
        constant = np.broadcast_to(np.eye(3), (int(good.sum()), 3, 3))
        rows.append(np.concatenate([arm[good], late[good][:, :, None], constant], axis=2))
        wanted.append(gap[good])
        block.append(start + np.flatnonzero(good) // size)
        start = int(block[-1][-1]) + 1
    if not rows:
        return None
    x, y, blocks = np.concatenate(rows), np.concatenate(wanted), np.concatenate(block)
    _, blocks = np.unique(blocks, return_inverse=True)
    count = int(blocks.max()) + 1
    scale = np.sqrt(np.einsum("nij,nij->j", x, x) / len(x))
    if count < _MIN_BLOCKS or (scale[:3] <= 1e-9).any():
        return None
    scale = np.where(scale > 0.0, scale, 1.0)
    x = x / scale
    weight = np.ones(len(y))
    solution = np.zeros(7)
    for _ in range(3):
        square = np.einsum("n,nij,nik->jk", weight, x, x) + 1e-12 * len(x) * np.eye(7)
        solution = np.linalg.solve(square, np.einsum("n,nij,ni->j", weight, x, y))
        left = np.linalg.norm(y - x @ solution, axis=1)
        spread = float(np.median(left))
        if spread <= 1e-12:
            break
        weight = 1.0 / np.maximum(1.0, left / (3.0 * spread))
    left = y - x @ solution
    influence = np.zeros((count, 7))
    np.add.at(influence, blocks, weight[:, None] * np.einsum("nij,ni->nj", x, left))
    inverse = np.linalg.inv(square)
    covariance = inverse @ (influence.T @ influence) @ inverse * count / (count - 1)
    std = np.sqrt(np.diag(covariance))[:3] / scale[:3]
    place = solution[:3] / scale[:3]
    without = solution.copy()
    without[:3] = 0.0
    gained = 1.0 - float((left**2).sum()) / max(float(((y - x @ without) ** 2).sum()), 1e-300)
    away = np.abs(place) > np.maximum(CLEAR * std, SMALLEST)
    return Lever(
        sensor, place, float(student.ppf(0.975, count - 1)) * std, bool(away.any() and gained > _SHARE)
    )
