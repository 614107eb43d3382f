"""Is what a model is tested on part of what it was fitted on? Told from the samples, not from names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError

if TYPE_CHECKING:
    from auvnn.logs.log import Log

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
    fitted, held = _rows(log), _rows(test)
    if len(held) == 0 or len(fitted) == 0:
        return
    shared = int(np.isin(held, fitted, assume_unique=True).sum())
    if shared >= _COUNT and shared > _SHARE * len(held):
        raise InputError(
            f"the test log '{test.name}' shares {shared} of {len(held)} samples with the log '{log.name}' "
            "that is fitted: the score would be a memory, not a prediction; hold out another run"
        )


def _rows(log: Log) -> NDArray[np.void]:
    parts = []
    for run in log.runs:
        sign = np.where(run.quaternion[:, :1] < 0.0, -1.0, 1.0)
        rows = np.concatenate([run.nu, sign * run.quaternion], axis=1)
        moving = np.isfinite(rows).all(axis=1) & (run.nu != 0.0).any(axis=1)
        parts.append(rows[moving].astype(np.float32) + np.float32(0.0))  # -0 and 0 are the same
    rows = np.ascontiguousarray(np.concatenate(parts))
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    found, counts = np.unique(keys, return_counts=True)
    return found[counts == 1]
