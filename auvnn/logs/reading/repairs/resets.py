"""Where an estimated pose starts again: a filter that resets, an origin that moves, another core in use.

Between two samples the pose can go no further than the measured velocities take it. A jump that is taken back is a
glitch; one that stays, with motion before and after it that agrees with the velocities, is a restart, and nothing
may be integrated or differentiated across it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.signals.rotation import conjugate, multiply, rotate
from auvnn.logs.signals.segments import default_gap

if TYPE_CHECKING:
    from auvnn.logs.run import Run

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

_STEP, _TURN = 0.3, 0.1  # m and rad that a jump must have, whatever the noise
_CLEAR = 20.0  # robust standard deviations of the usual mismatch of a step
_AROUND = 2.0  # s on either side over which it must stay
_STAYS = 0.7  # of the jump that is still there then
_QUIET = 0.25  # of the jump: what the stretches beside it may disagree with the velocities
_OFTEN = 10.0  # s: a pose that jumps more often than this is a poor sensor, not an estimator with resets


def restarts(run: Run) -> Rows:
    """Return the first samples of the stretches between which the pose starts again, in order.

    They come from the column `reset`, where there is one, and from jumps of position and attitude.
    """
    found = [*counted(run), *jumps(run)]
    return np.unique(np.array(found, dtype=np.intp))


def counted(run: Run) -> Rows:
    """Return the samples at which the column `reset` changes."""
    if run.reset is None:
        return np.zeros(0, dtype=np.intp)
    rows = np.flatnonzero(np.isfinite(run.reset))
    return rows[1:][np.diff(run.reset[rows]) != 0.0]


def jumps(run: Run) -> Rows:
    """Return the samples after jumps of position or attitude that contradict the velocities and stay."""
    return np.union1d(_position(run), _attitude(run)).astype(np.intp)


def _position(run: Run) -> Rows:
    if run.position is None:
        return np.zeros(0, dtype=np.intp)
    rows = np.flatnonzero(
        np.isfinite(run.position).all(1)
        & np.isfinite(run.quaternion).all(1)
        & np.isfinite(run.nu[:, :3]).all(1)
    )
    if len(rows) < 10:
        return np.zeros(0, dtype=np.intp)
    t = run.t[rows]
    world = rotate(run.quaternion[rows], run.nu[rows, :3])
    steps = 0.5 * (world[1:] + world[:-1]) * np.diff(t)[:, None]
    left = np.diff(run.position[rows], axis=0) - steps
    size = np.linalg.norm(left, axis=1)
    # What the velocities would explain if their scale were wrong is no jump.
    room = 2.0 * np.linalg.norm(steps, axis=1)
    return _lasting(t, rows, size, _limit(size, _STEP) + room, np.cumsum(left, axis=0))


def _attitude(run: Run) -> Rows:
    rows = np.flatnonzero(np.isfinite(run.quaternion).all(1) & np.isfinite(run.nu[:, 3:]).all(1))
    if len(rows) < 10:
        return np.zeros(0, dtype=np.intp)
    t, q, rate = run.t[rows], run.quaternion[rows], run.nu[rows, 3:]
    turn = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, None]
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    half = np.concatenate([np.cos(0.5 * angle), 0.5 * turn * np.sinc(0.5 * angle / np.pi)], axis=1)
    over = multiply(q[1:], conjugate(multiply(q[:-1], half)))
    # In world axes, where turns about the vertical of a heading reset add up.
    left = (
        2.0
        * np.arctan2(np.linalg.norm(over[:, 1:], axis=1), np.abs(over[:, 0]))[:, None]
        * _unit(over[:, 1:] * np.sign(over[:, :1] + (over[:, :1] == 0)))
    )
    size = np.linalg.norm(left, axis=1)
    return _lasting(t, rows, size, _limit(size, _TURN) + 2.0 * angle[:, 0], np.cumsum(left, axis=0))


def _unit(v: Array) -> Array:
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)


def _limit(size: Array, least: float) -> float:
    return max(least, _CLEAR * 1.4826 * float(np.median(size)))


def _lasting(t: Array, rows: Rows, size: Array, limit: Array, total: Array) -> Rows:
    """Return the samples after steps that are beyond the limit and not taken back.

    Args:
        t: (M,), s, of the samples with a pose.
        rows: their indices.
        size: mismatch of the step from each to the next, (M - 1,).
        limit: what it may be, (M - 1,).
        total: sum of the mismatch up to and including each step, (M - 1, 3).
    """
    steps = np.flatnonzero((size > limit) & (np.diff(t) <= default_gap(t)))
    if len(steps) == 0 or len(steps) * _OFTEN > t[-1] - t[0]:
        return np.zeros(0, dtype=np.intp)
    total = np.concatenate([np.zeros((1, total.shape[1])), total])  # at each sample
    kept = []
    for k in steps:
        before = (t >= t[k] - _AROUND) & (np.arange(len(t)) <= k)
        after = (t <= t[k + 1] + _AROUND) & (np.arange(len(t)) > k)
        if t[k] - t[0] < 0.5 * _AROUND or t[-1] - t[k + 1] < 0.5 * _AROUND:
            continue
        jump = np.median(total[after], axis=0) - np.median(total[before], axis=0)
        spread = max(_spread(total[before]), _spread(total[after]))
        if np.linalg.norm(jump) > _STAYS * size[k] and spread < _QUIET * size[k]:
            kept.append(rows[k + 1])
    return np.array(kept, dtype=np.intp)


def _spread(points: Array) -> float:
    return float(np.linalg.norm(points - np.median(points, axis=0), axis=1).max())
