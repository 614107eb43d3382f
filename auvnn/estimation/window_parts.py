"""Windows in parts, with the same rows, commands and sensors: over a shorter time free running is more nearly linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.metrics.windows import Windows
from auvnn.models.inputs import Inputs

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
    joined = _joined(parts).pick(order)
    return joined, whole[order], begins[order]


def _part(windows: Windows, begin: int, rows: int) -> Windows:
    """Return so many rows of every window from one of its samples on; padded at the end where a window is shorter."""
    last = windows.mask.shape[1] - 1
    index = torch.as_tensor(np.minimum(np.arange(begin, begin + rows), last))
    beyond = torch.as_tensor((np.arange(begin, begin + rows) <= last).astype(float))
    both = torch.cat([torch.arange(begin, begin + windows.warmup), index + windows.warmup])
    given = windows.inputs

    def of(x: Tensor | None, chosen: Tensor) -> Tensor | None:
        return None if x is None else x[:, chosen]

    return replace(
        windows,
        first=windows.first + begin,
        times=windows.times[:, both],
        eta=windows.eta[:, index],
        nu=windows.nu[:, index],
        nu_dot=of(windows.nu_dot, index),
        inputs=Inputs(
            given.command[:, both],
            *(
                of(x, both)
                for x in (given.fins, given.voltage, given.altitude, given.within, given.fins_within)
            ),
        ),
        mask=windows.mask[:, index] * beyond[:, None],
        length=np.clip(windows.length - begin, 0, rows),
    )


def _joined(parts: list[Windows]) -> Windows:
    def of(name: str) -> Tensor | None:
        found = [getattr(p, name) if hasattr(p, name) else getattr(p.inputs, name) for p in parts]
        return None if found[0] is None else torch.cat(found)

    def rows(name: str) -> NDArray[np.int64]:
        return np.concatenate([getattr(p, name) for p in parts])

    command, times, eta, nu, mask = (of(n) for n in ("command", "times", "eta", "nu", "mask"))
    assert command is not None and times is not None and eta is not None and nu is not None
    assert mask is not None
    return replace(
        parts[0],
        run=rows("run"),
        first=rows("first"),
        times=times,
        eta=eta,
        nu=nu,
        nu_dot=of("nu_dot"),
        inputs=Inputs(command, *(of(n) for n in ("fins", "voltage", "altitude", "within", "fins_within"))),
        mask=mask,
        length=rows("length"),
    )
