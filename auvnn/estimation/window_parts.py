"""Windows in parts, with the same rows, commands and sensors: over a shorter time free running is more nearly linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.metrics.windows import Windows
from auvnn.models.inputs import joined

# The least samples of a part.
SAMPLES = 8


def split(windows: Windows, span: float) -> tuple[Windows, NDArray[np.int64], NDArray[np.int64]]:
    """Return the windows in parts of about a length, and of each part the window (N,) and the sample (N,) it begins at.

    Successive parts share a sample, as successive windows do. What is left of a window that ended early counts if it has
    enough samples.

    Args:
        windows: B windows.
        span: s.
    """
    rows = windows.mask.shape[1]
    times = windows.times[:, windows.warmup :]
    longest = float((times[:, -1] - times[:, 0]).max())
    count = min(max(round(longest / span), 1), max((rows - 1) // (SAMPLES - 1), 1))
    if count == 1:
        whole = np.arange(len(windows))
        return windows, whole, np.zeros(len(windows), dtype=np.int64)
    size = -(-(rows - 1) // count)
    parts = [_part(windows, k * size, size + 1) for k in range(count)]
    long = np.concatenate([p.length for p in parts]) >= min(SAMPLES, size + 1)
    whole = np.tile(np.arange(len(windows)), count)
    begins = np.repeat(np.arange(count) * size, len(windows))
    # In the order of time within each window.
    order = np.lexsort((begins, whole))
    order = order[long[order]]
    return _joined(parts).pick(order), whole[order], begins[order]


def _part(windows: Windows, begin: int, rows: int) -> Windows:
    """Return so many rows of every window from one of its samples on; padded at the end where a window is shorter."""
    last = windows.mask.shape[1] - 1
    index = torch.as_tensor(np.minimum(np.arange(begin, begin + rows), last))
    beyond = torch.as_tensor((np.arange(begin, begin + rows) <= last).astype(float))
    both = torch.cat([torch.arange(begin, begin + windows.warmup), index + windows.warmup])

    return replace(
        windows,
        first=windows.first + begin,
        times=windows.times[:, both],
        eta=windows.eta[:, index],
        nu=windows.nu[:, index],
        nu_dot=None if windows.nu_dot is None else windows.nu_dot[:, index],
        inputs=windows.inputs.mapped(lambda x: x[:, both]),
        mask=windows.mask[:, index] * beyond[:, None],
        length=np.clip(windows.length - begin, 0, rows),
    )


def _joined(parts: list[Windows]) -> Windows:
    def cat(name: str) -> Tensor:
        return torch.cat([getattr(p, name) for p in parts])

    def rows(name: str) -> NDArray[np.int64]:
        return np.concatenate([getattr(p, name) for p in parts])

    return replace(
        parts[0],
        run=rows("run"),
        first=rows("first"),
        times=cat("times"),
        eta=cat("eta"),
        nu=cat("nu"),
        nu_dot=None if parts[0].nu_dot is None else cat("nu_dot"),
        inputs=joined([p.inputs for p in parts]),
        mask=cat("mask"),
        length=rows("length"),
    )
