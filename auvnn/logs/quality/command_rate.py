"""Whether commands change between the samples of a log: neighbours then predict little of each of them.

A command that is sampled often enough lies near the cubic through two samples on either side of it,
(-u[k-2] + 4 u[k-1] + 4 u[k+1] - u[k+2]) / 6. What is left of it, as a share of the command's standard deviation, is small
for whatever is band-limited well below half the sampling rate, zero where a command is constant, and one for white
noise. The median is taken, so that steps here and there count for nothing, and commands that are held over several
samples are no question at all: what changes them is as slow as the log shows.

A controller that decides at the rate of the log itself, on measurements with noise, leaves the same trace: from the log
alone the two cannot be told apart, and what is said holds for both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.quality.finding import Finding

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

Array = NDArray[np.float64]
CUBIC = np.array([-1.0, 4.0, 0.0, 4.0, -1.0]) / 6.0
# White noise leaves sqrt(1 + 34/36) of its standard deviation, and 0.6745 of that as a median of absolute values.
WHITE = float(np.sqrt(1.0 + 34.0 / 36.0) * 0.6745)
# From this share on the motion between samples depends on what the log does not have.
CLEAR = 0.08
# Commands that are held over two samples and more on average are a staircase.
CHANGING = 0.5
# Fewest samples of a run from which a median says anything.
FEWEST = 50
# Steps that differ by more than this share of their median do not lie evenly.
EVEN = 0.2


def unpredicted(run: Run, y: Array) -> tuple[float, float]:
    """Return what neighbours leave of a command as a share of its standard deviation, and the share of changes.

    Args:
        run: for the times.
        y: command of each sample, (N,).

    Returns:
        (0, 0) where there are too few even samples, or the command rests.
    """
    if len(y) < FEWEST:
        return 0.0, 0.0
    steps = np.diff(run.t)
    even = np.abs(steps - run.dt) <= EVEN * run.dt
    around = np.lib.stride_tricks.sliding_window_view(y, 5)
    good = np.isfinite(around).all(1) & np.lib.stride_tricks.sliding_window_view(even, 4).all(1)
    if good.sum() < FEWEST:
        return 0.0, 0.0
    spread = float(around[good, 2].std())
    if spread <= 1e-9 * max(float(np.abs(around[good, 2]).max()), 1e-300):
        return 0.0, 0.0
    changing = float((np.diff(y)[1:-2][good] != 0.0).mean())
    left = np.abs(around[good, 2] - around[good] @ CUBIC)
    return float(np.median(left)) / WHITE / spread, changing


def between_samples(log: Log) -> list[Finding]:
    """Return a note where commands change from sample to sample by what their neighbours do not predict.

    Args:
        log: that is judged.
    """
    worst: dict[str, float] = {}
    for run in log.runs:
        for name, y in run.columns():
            if name.startswith(("thruster_", "tau_", "fin_")) and name not in run.extra:
                share, changing = unpredicted(run, np.asarray(y, dtype=float))
                if share > CLEAR and changing > CHANGING:
                    worst[name] = max(worst.get(name, 0.0), min(share, 1.0))
    if not worst:
        return []
    rate = 1.0 / float(np.median([run.dt for run in log.runs]))
    names = list(worst)
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    largest = 100.0 * max(worst.values())
    what = (
        f"{shown}: the samples before and after predict a command only to {largest:.0f} % of its standard deviation: "
        f"it is decided at the log's {rate:.3g} Hz or faster, and where it is faster the log lacks what happens between"
    )
    cure = (
        "log commands at the controller's rate, or expect diagnose to ask the log how they go from sample to sample; "
        "nothing is lost where the controller decides once per sample and holds"
    )
    return [Finding("info", "commands", what, cure)]
