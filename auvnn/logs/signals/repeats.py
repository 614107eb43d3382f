"""Samples that repeat the one before: a sensor that is slower than the log, whose last value stands until the next.

A DVL measures five times a second and stands in a log of 20 Hz; three of four rows then hold an old velocity. An old
value is no measurement of its moment: read as one it looks like a lag, a force and noise that is not white.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# At least half of the values stand for so many rows before a channel counts as held.
ROWS = 2
# Share of the values that are new ones: quantised signals come back to the same few values.
DISTINCT = 0.5
# Fewer values than this say nothing of a habit.
FEWEST = 20


def repeats(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples of a sensor repeat the one before because it has not measured again.

    All channels of a sensor have to stand still together, as a rule and not now and then (a vehicle at rest), and to
    take ever new values when they change (quantised signals do not).

    Args:
        values: channels of one sensor, (N, k); NaN is missing and repeats nothing.

    Returns:
        Mask (N,); all False where the sensor keeps up with the log.
    """
    same = np.zeros(len(values), dtype=bool)
    if len(values) < FEWEST:
        return same
    known = np.isfinite(values).all(axis=1)
    there = np.flatnonzero(known)
    # A value that stands across a row that is missing is still the old one.
    same[there[1:]] = (values[there[1:]] == values[there[:-1]]).all(axis=1)
    fresh = np.flatnonzero(known & ~same)
    if len(fresh) < FEWEST:
        return np.zeros_like(same)
    # How many rows each value stands.
    stands = np.add.reduceat(same.astype(int), fresh) + 1
    distinct = len(np.unique(values[fresh], axis=0)) / len(fresh)
    if np.median(stands) < ROWS or distinct < DISTINCT:
        return np.zeros_like(same)
    return same


def stale(
    position: NDArray[np.float64] | None, quaternion: NDArray[np.float64], nu: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which samples of position, attitude and velocity repeat the last one, by channel.

    Args:
        position: NED, m, (N, 3), or None.
        quaternion: scalar first, (N, 4).
        nu: m/s and rad/s, (N, 6).

    Returns:
        Mask (N, 12): x, y, z, phi, theta, psi, u, v, w, p, q, r.
    """
    found = np.zeros((len(nu), 12), dtype=bool)
    if position is not None:
        # Positions and depth come from separate sensors.
        found[:, :2] = repeats(position[:, :2])[:, None]
        found[:, 2] = repeats(position[:, 2:])
    found[:, 3:6] = repeats(quaternion)[:, None]
    found[:, 6:9] = repeats(nu[:, :3])[:, None]
    found[:, 9:12] = repeats(nu[:, 3:])[:, None]
    return found
