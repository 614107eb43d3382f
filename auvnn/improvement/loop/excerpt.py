"""The part of a long log that a diagnosis looks at."""

from __future__ import annotations

import numpy as np

from auvnn.logs import Log, Run
from auvnn.metrics.rollouts import scale_of

# No run is cut shorter, s.
SHORTEST = 20.0


def liveliest(log: Log, seconds: float) -> Log:
    """Return of every run its liveliest stretch, together about this long; a shorter log as it is.

    Lively is what moves much in all velocities, each measured by its own spread.
    """
    if log.duration <= seconds:
        return log
    share, spread = seconds / log.duration, np.maximum(scale_of(log).std, 1e-9)
    return Log.from_runs(
        [_cut(run, max(share * run.duration, SHORTEST), spread) for run in log.runs], log.name, log.repairs
    )


def _cut(run: Run, seconds: float, spread: np.ndarray) -> Run:
    if run.duration <= seconds:
        return run
    energy = np.cumsum(np.nan_to_num((((run.nu - np.nanmean(run.nu, 0)) / spread) ** 2).sum(1)))
    length = int(seconds / run.dt)
    begin = int(np.argmax(energy[length:] - energy[:-length])) if len(energy) > length else 0
    return run.cut(slice(begin, begin + length))
