"""Columns side by side in one array, without a copy where they lie so already: a log may fill half of the memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_BLOCK = 4_096


def stacked(columns: list[Array]) -> Array:
    """Return columns (N,) as one array (N, k); the array itself whose columns they are, in their order and all of them.

    Args:
        columns: at least one; the list is empty afterwards, so that what is held nowhere else is given up.
    """
    whole = _one(columns)
    if whole is None:
        whole = np.empty((len(columns[0]), len(columns)))
        for at in range(0, len(whole), _BLOCK):  # what is written lies together, as it does in the cache
            whole[at : at + _BLOCK] = np.array([c[at : at + _BLOCK] for c in columns]).T
    columns.clear()
    return whole


def _one(columns: list[Array]) -> Array | None:
    owner = columns[0].base
    if not isinstance(owner, np.ndarray) or owner.size != len(columns[0]) * len(columns):
        return None
    if owner.dtype != np.float64 or not owner.flags.c_contiguous:
        return None
    whole = owner.reshape(len(columns[0]), len(columns))
    same = all(
        c.base is owner and c.strides == whole.strides[:1] and c.ctypes.data == whole.ctypes.data + 8 * i
        for i, c in enumerate(columns)
    )
    return whole if same else None
