"""Attitudes that turn faster than the measured rates allow are not attitudes: leave them out.

Beluga's quaternions were interpolated number by number through sign flips. Where the norm suffered, the reader
drops the sample by itself; many others came out with a norm of one and a wrong direction, up to half a turn off,
alone or in groups. What gives them away is the rate: between two samples the attitude cannot turn further than
the rates make it, whatever their signs.
"""

from dataclasses import replace

import numpy as np

from auvnn.logs import Log, Run

FACTOR, MARGIN = 3.0, 0.05  # times what the rates say, plus rad: room for noise, lag and a rate between samples
SHORTEST = 1.0  # s: what lasts longer between two jumps is kept; it may be the truth after a reset


def glitches(run: Run) -> np.ndarray:
    """Return a mask (N,) of samples whose attitude contradicts their neighbours and the rates."""
    mask = np.zeros(run.samples, dtype=bool)
    rows = np.flatnonzero(np.isfinite(run.quaternion).all(1) & np.isfinite(run.nu).all(1))
    if len(rows) < 3:
        return mask
    q = run.quaternion[rows]
    turned = 2 * np.arccos(np.clip(np.abs((q[1:] * q[:-1]).sum(1)), 0.0, 1.0))
    rate = np.linalg.norm(run.nu[rows, 3:], axis=1)
    allowed = MARGIN + FACTOR * np.maximum(rate[1:], rate[:-1]) * np.diff(run.t[rows])
    edges = np.concatenate([[0], np.flatnonzero(turned > allowed) + 1, [len(rows)]])
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        if run.t[rows[end - 1]] - run.t[rows[begin]] < SHORTEST:
            mask[rows[begin:end]] = True
    return mask


def without_glitches(log: Log) -> tuple[Log, list[int]]:
    """Return the log with those attitudes missing, and how many there were in each run."""
    runs, counts = [], []
    for run in log.runs:
        bad = glitches(run)
        runs.append(replace(run, quaternion=np.where(bad[:, None], np.nan, run.quaternion)))
        counts.append(int(bad.sum()))
    return replace(log, runs=tuple(runs)), counts
