"""Recorded attitudes made unit quaternions without sign flips; what is no attitude becomes missing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.signals.rotation import continuous, from_euler, signs

Array = NDArray[np.float64]

_TOLERANCE = 0.03  # of the norm: more is what interpolation through a sign flip leaves behind
_SMALLEST = 0.5
_EXACT = 1e-12  # a norm this close to one is left alone, so that a log reads back as it was written
_STEEP = math.radians(85.0)
_TOO_LARGE = 3.0 * math.pi
_MOVING = 0.02  # rad/s


def from_quaternions(raw: Array, where: str) -> tuple[Array, list[Repair]]:
    """Return unit quaternions, NaN where the norm says that the sample is no rotation.

    Args:
        raw: (w, x, y, z), (N, 4); NaN is missing.
        where: file and run, for the messages.

    Raises:
        InputError: the typical norm is below 0.5, or most samples are no rotation.
    """
    repairs: list[Repair] = []
    norm = np.sqrt(np.einsum("ij,ij->i", raw, raw))
    present = np.isfinite(norm)  # an absurd number overflows here and counts as missing
    if not present.any():
        return np.full_like(raw, np.nan), repairs
    typical = float(np.median(norm[present]))
    if typical < _SMALLEST:
        raise InputError(
            f"{where}: the quaternion's typical norm is {typical:.3g}, not 1: "
            "are qw qx qy qz really the four parts of one quaternion?"
        )
    if abs(typical - 1.0) > _TOLERANCE:
        words = f"quaternions with a typical norm of {typical:.3g} scaled to 1"
        repairs.append(
            Repair(words, where, int(present.sum()), "warning", "check where the factor comes from")
        )
    else:
        typical = 1.0
    wrong = present & (np.abs(norm / typical - 1.0) > _TOLERANCE)
    n_wrong = int(wrong.sum())
    if n_wrong > 0.5 * present.sum():
        raise InputError(
            f"{where}: {n_wrong} of {int(present.sum())} quaternions have a norm off by more than 3 % "
            f"(from {norm[present].min():.3g} to {norm[present].max():.3g}): this is no attitude"
        )
    if n_wrong:
        words = f"quaternions that are no rotation (norm down to {norm[wrong].min():.2g}) read as missing"
        cure = "interpolate attitudes as rotations, not number by number"
        repairs.append(Repair(words, where, n_wrong, cure=cure))
    quaternion = raw
    if n_wrong or not present.all():
        quaternion = raw.copy()
        quaternion[wrong | ~present] = np.nan
    uneven = present & ~wrong & (np.abs(norm - 1.0) > _EXACT)
    if uneven.any():
        quaternion = quaternion / np.where(uneven, norm, 1.0)[:, None]
    visible = int((np.abs(norm[present & ~wrong] / typical - 1.0) > 1e-6).sum())
    if visible:
        repairs.append(Repair("quaternions scaled to unit length", where, visible, "info"))
    turned = signs(quaternion)
    flips = int((np.diff(turned[present & ~wrong]) != 0.0).sum())
    if flips:
        repairs.append(Repair("sign flips of the quaternion (the same attitude) undone", where, flips))
        quaternion = quaternion * turned[:, None]
    return quaternion, repairs


def from_angles(angles: Array, t: Array, yaw_rate: Array, where: str) -> tuple[Array, list[Repair]]:
    """Return unit quaternions of recorded roll, pitch and yaw.

    Args:
        angles: phi, theta, psi, rad, (N, 3), wrapped or not.
        t: time, s, (N,).
        yaw_rate: r, rad/s, (N,), to tell degrees from a heading that was unwrapped over many turns.
        where: file and run, for the messages.

    Raises:
        InputError: the angles are in degrees.
    """
    repairs: list[Repair] = []
    largest = [float(np.nanmax(np.abs(a))) if np.isfinite(a).any() else 0.0 for a in angles.T]
    steep = largest[1] if len(largest) > 1 else 0.0
    if (
        largest[0] > _TOO_LARGE
        or steep > _TOO_LARGE
        or (largest[2] > _TOO_LARGE and _in_degrees(angles, t, yaw_rate))
    ):
        which = int(np.argmax(largest))
        raise InputError(
            f"{where}: {('phi', 'theta', 'psi')[which]} reaches {largest[which]:.4g}: in degrees? "
            "Mapping: angles: deg"
        )
    n_steep = int((np.abs(angles[:, 1]) > _STEEP).sum())
    if n_steep:
        words = "samples with a pitch within 5 degrees of the vertical, where roll and yaw run together"
        repairs.append(Repair(words, where, n_steep, "warning", "log the attitude as a quaternion"))
    passes = _over_the_top(angles)
    if passes:
        words = "passes of the vertical, where roll and yaw jump by half a turn, carried on as quaternions"
        repairs.append(Repair(words, where, passes))
    return continuous(from_euler(angles)), repairs


def _over_the_top(angles: Array) -> int:
    """Return how often the pitch passes +-90 degrees: beyond it, or by a jump of roll and yaw near it."""
    rows = angles[np.isfinite(angles).all(axis=1)]
    if len(rows) < 2:
        return 0
    beyond = np.cos(rows[:, 1]) < 0.0
    turned = np.abs(np.remainder(np.diff(rows[:, [0, 2]], axis=0) + np.pi, 2.0 * np.pi) - np.pi) > 0.5 * np.pi
    near = np.minimum(np.abs(np.cos(rows[1:, 1])), np.abs(np.cos(rows[:-1, 1]))) < math.cos(
        math.radians(60.0)
    )
    return int(((beyond[1:] != beyond[:-1]) | (turned.all(axis=1) & near)).sum())


def _in_degrees(angles: Array, t: Array, yaw_rate: Array) -> bool:
    """Say whether a large heading is in degrees: it then turns 57 times as fast as r says."""
    step, rate = np.diff(angles[:, 2]), yaw_rate[:-1]
    slope = step / np.diff(t)
    # Wraps at 360 degrees or 2 pi and turns that are too slow tell nothing.
    good = np.isfinite(slope) & (np.abs(rate) > _MOVING) & (np.abs(step) < 100.0)
    if good.sum() < 20:
        return True
    ratio = float(np.median(slope[good] / rate[good]))
    return not 1.0 / 3.0 < abs(ratio) < 3.0
