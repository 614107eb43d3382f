"""What is left out in turn: runs; and of a run that alone drives a degree of freedom, every fifth stretch of it.

Leaving out the only run that moves in roll says what a model is worth that has never seen roll. That is a fair question,
but not the one that decides whether a step pays: of such a run blocks of time are left out instead, spread evenly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Log
from auvnn.metrics.rollouts import scale_of
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Runs are left out one at a time up to so many; beyond that, so many groups of them.
MOST, FIFTHS = 8, 5
# A run that holds more than this share of the motion in an excited degree of freedom drives it alone.
ALONE = 0.8
# Blocks of such a run last so long, s, or less where that leaves no two for each fold.
BLOCK = 25.0


@dataclass(frozen=True)
class Folds:
    """Which fold each instant of a log belongs to.

    Attributes:
        edges: run number to the times at which its blocks end, s.
        fold: run number to each block's fold.
        words: how the folds were made.
    """

    edges: dict[int, Array]
    fold: dict[int, NDArray[np.int64]]
    words: str

    @classmethod
    def of(cls, log: Log) -> Folds:
        """Return the folds of a log."""
        alone = _alone(log)
        edges, fold, at = {}, {}, 0
        whole = [run for run in log.runs if run.number not in alone]
        for k, run in enumerate(whole):
            edges[run.number], fold[run.number] = np.zeros(0), np.array([k % MOST], dtype=np.int64)
            at = max(at, k % MOST + 1)
        for run in log.runs:
            if run.number not in alone:
                continue
            count = max(FIFTHS, int(run.duration // min(BLOCK, run.duration / (2 * FIFTHS))))
            edges[run.number] = run.t[0] + run.duration * np.arange(1, count) / count
            fold[run.number] = at + np.arange(count) % FIFTHS
        if not alone:
            words = (
                "each run left out in turn"
                if len(whole) <= MOST
                else f"{MOST} groups of runs left out in turn"
            )
        elif not whole:
            words = (
                "fifths of the run left out in turn"
                if len(alone) == 1
                else "fifths of every run left out in turn"
            )
        else:
            numbers = ", ".join(map(str, sorted(alone)))
            words = (
                f"each run left out in turn; of {numbers}, which alone drives some degrees of freedom, fifths"
            )
        return cls(edges, fold, words)

    @property
    def numbers(self) -> list[int]:
        """Return the folds."""
        return sorted({int(f) for folds in self.fold.values() for f in folds})

    def at(self, run: int, t: Array) -> NDArray[np.int64]:
        """Return the fold of instants of a run."""
        return self.fold[run][np.searchsorted(self.edges[run], t, side="right")]

    def windows(self, windows: Windows) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the fold of each window, (B,), and (B, F) whether it shares no instant with each of `numbers`."""
        times = windows.times[:, windows.warmup :].numpy()
        end = times[np.arange(len(times)), windows.length - 1]
        return self.stretches(windows.run, times[:, 0], end)

    def stretches(
        self, run: NDArray, begin: Array, end: Array
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the same of stretches of runs, from and to these times.

        Args:
            run: number of each stretch's run, (N,).
            begin: s, (N,).
            end: s, (N,).
        """
        own = np.zeros(len(run), dtype=np.int64)
        free = np.ones((len(run), len(self.numbers)), dtype=bool)
        for number in np.unique(run):
            mine = np.flatnonzero(run == number)
            marks = [self.at(int(number), x[mine]) for x in (begin, 0.5 * (begin + end), end)]
            own[mine] = marks[1]
            for k, f in enumerate(self.numbers):
                free[mine, k] = ~np.any([m == f for m in marks], axis=0)
        return own, free


def _alone(log: Log) -> set[int]:
    if len(log.runs) == 1:
        return {log.runs[0].number}
    scale = scale_of(log)
    energy = np.stack([np.nansum((run.nu - np.nanmean(run.nu, 0)) ** 2, axis=0) for run in log.runs])
    share = energy / np.maximum(energy.sum(0), 1e-300)
    return {
        run.number for run, own in zip(log.runs, share, strict=True) if (own[scale.excited] > ALONE).any()
    }
