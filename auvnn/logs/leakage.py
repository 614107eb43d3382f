"""Is what a model is tested on part of what it was fitted on? Told from the samples, not from names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

_SHARE = 0.02
_COUNT = 5


def leakage(log: Log, test: Log) -> None:
    """Refuse a test log that shares samples with the log that is fitted.

    Samples are compared by attitude and velocity to single precision, so that the same dive is found under
    another name, in another format or with another origin of time. Samples at rest and samples that occur
    twice in one log say nothing and are left out.

    Args:
        log: what is fitted.
        test: what is held out.

    Raises:
        InputError: more than 2 % (and at least five) of the test's samples are in the log.
    """
    fitted, held = rows_of(log.runs), rows_of(test.runs)
    if len(held) == 0 or len(fitted) == 0:
        return
    shared = int(np.isin(held, fitted, assume_unique=True).sum())
    refuse_shared(shared, len(held), f"the test log '{test.name}'", f"the log '{log.name}'")


def refuse_shared(shared: int, held: int, test: str, log: str) -> None:
    """Refuse a test of which so many of its samples that were looked for are in the log that is fitted.

    Args:
        shared: samples that are in both.
        held: samples that were looked for.
        test: name of the test log.
        log: name of the log that is fitted.

    Raises:
        InputError: they are too many.
    """
    if shared >= _COUNT and shared > _SHARE * held:
        raise InputError(
            f"{test} shares {shared} of {held} samples with {log} "
            "that is fitted: the score would be a memory, not a prediction; hold out another run"
        )


def rows_of(runs: Iterable[Run]) -> NDArray[np.void]:
    """Return a key for each sample of some runs that is moving and occurs once."""
    parts = []
    for run in runs:
        sign = np.where(run.quaternion[:, :1] < 0.0, -1.0, 1.0)
        # Of what has no sensor there is nothing to compare.
        seen = run.measured.nu
        run = replace(run, nu=np.where(np.isnan(seen).all(axis=0), 0.0, seen))
        rows = np.concatenate([run.nu, sign * run.quaternion], axis=1)
        moving = np.isfinite(rows).all(axis=1) & (run.nu != 0.0).any(axis=1)
        parts.append(rows[moving].astype(np.float32) + np.float32(0.0))  # -0 and 0 are the same
    rows = np.ascontiguousarray(np.concatenate(parts))
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    found, counts = np.unique(keys, return_counts=True)
    return found[counts == 1]
