"""Poses that contradict the measured velocities are no measurements: leave them out.

Beluga's pose stands still to the last digit for up to a second while the gyro turns on, and at times it jumps to
somewhere else, up to half a turn off, alone or in groups: a tracker that loses the vehicle. Quaternions were also
interpolated number by number through sign flips; where the norm suffered the reader drops the sample by itself.
What gives the rest away is the velocity: between two samples the pose can neither stay put nor go further than
the velocity takes it, whatever the signs.
"""

from dataclasses import replace

import numpy as np

from auvnn.logs import Log, Run

FACTOR = 2.0  # times what the velocity says: room for lag, noise and whatever is between two samples
TURN, STEP = 0.05, 0.05  # rad and m beyond that
SHORTEST = 5.0  # s: what lasts longer between two jumps is kept; it may be the truth after a reset


def held(pose: np.ndarray) -> np.ndarray:
    """Return a mask (N,) of rows that repeat the one before to the last digit."""
    mask = np.zeros(len(pose), dtype=bool)
    mask[1:] = (np.abs(np.diff(pose, axis=0)) < 1e-9).all(1)
    return mask


def contradicted(
    t: np.ndarray, moved: np.ndarray, speed: np.ndarray, rows: np.ndarray, room: float
) -> np.ndarray:
    """Return a mask (N,) of short stretches between two jumps.

    Args:
        t: (N,), s.
        moved: how far the pose goes from each of `rows` to the next, (M - 1,).
        speed: (N,), measured.
        rows: samples with a pose, (M,).
        room: how far it may go at rest.
    """
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    edges = np.flatnonzero(moved > room + FACTOR * np.diff(way[rows])) + 1
    mask = np.zeros(len(t), dtype=bool)
    for begin, end in zip([0, *edges], [*edges, len(rows)], strict=True):
        if t[rows[end - 1]] - t[rows[begin]] < SHORTEST:
            mask[rows[begin:end]] = True
    return mask


def doubtful(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return masks (N,) of attitudes and of positions that contradict the velocities."""
    speed, rate = (
        np.nan_to_num(np.linalg.norm(run.nu[:, part], axis=1)) for part in (slice(0, 3), slice(3, 6))
    )
    masks = []
    for pose, size, room in ((run.quaternion, rate, TURN), (run.position, speed, STEP)):
        mask = held(pose)
        rows = np.flatnonzero(np.isfinite(pose).all(1) & ~mask)
        if len(rows) > 2:
            if pose.shape[1] == 4:
                moved = 2 * np.arccos(np.clip(np.abs((pose[rows][1:] * pose[rows][:-1]).sum(1)), 0.0, 1.0))
            else:
                moved = np.linalg.norm(np.diff(pose[rows], axis=0), axis=1)
            mask |= contradicted(run.t, moved, size, rows, room)
        masks.append(mask)
    return masks[0], masks[1]


def without_glitches(log: Log) -> tuple[Log, list[tuple[int, int]]]:
    """Return the log with those poses missing, and how many attitudes and positions it was in each run."""
    runs, counts = [], []
    for run in log.runs:
        turned, moved = doubtful(run)
        runs.append(
            replace(
                run,
                quaternion=np.where(turned[:, None], np.nan, run.quaternion),
                position=np.where(moved[:, None], np.nan, run.position),
            )
        )
        counts.append((int(turned.sum()), int(moved.sum())))
    return replace(log, runs=tuple(runs)), counts
