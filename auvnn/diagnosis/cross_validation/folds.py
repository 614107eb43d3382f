"""Which parts of a log are left out in turn: its runs, or fifths of a single one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FOLDS
from auvnn.errors import InputError
from auvnn.logs import Log, Run

# Runs are left out one at a time up to so many; beyond that, so many groups of runs.
MOST_FOLDS = 8


@dataclass(frozen=True)
class Fold:
    """A part of a log that is left out, and the rest.

    Attributes:
        fit: what is fitted to.
        held: what is left out.
    """

    fit: Log
    held: Log


def folds_of(log: Log, most: int = MOST_FOLDS) -> list[Fold]:
    """Return the folds of a log: its runs one by one, groups of them where there are many, or fifths of a single one.

    Args:
        log: the log.
        most: folds at most.

    Raises:
        InputError: a single run is too short for that.
    """
    runs: list[Run] = [*log.runs]
    if len(runs) > 1:
        groups = np.arange(len(runs)) % min(most, len(runs))
        return [
            Fold(
                Log.from_runs(
                    [r for r, g in zip(runs, groups, strict=True) if g != k], log.name, log.repairs
                ),
                Log.from_runs(
                    [r for r, g in zip(runs, groups, strict=True) if g == k], log.name, log.repairs
                ),
            )
            for k in np.unique(groups)
        ]
    run = runs[0]
    found: list[Fold] = []
    edges = np.searchsorted(run.t, run.t[0] + run.duration * np.arange(1, FOLDS) / FOLDS)
    edges = [0, *edges.tolist(), run.samples]
    if min(np.diff(edges)) < 3:
        raise InputError(f"{log.name} has {run.samples} samples: too few to leave out a fifth of them")
    for a, b in pairwise(edges):
        rest = [slice(0, a), slice(b, run.samples)]
        kept = [run.cut(s, number=run.number + k) for k, s in enumerate(rest) if s.stop - s.start > 2]
        found.append(
            Fold(
                Log.from_runs(kept, log.name, log.repairs),
                Log.from_runs([run.cut(slice(a, b))], log.name, log.repairs),
            )
        )
    return found
