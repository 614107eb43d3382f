"""Where a recording is unbroken: stretches between gaps in time and missing samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GAP_STEPS = 5.0


def default_gap(t: NDArray[np.float64]) -> float:
    """Return the longest step that is not yet a gap: five median steps, s."""
    return GAP_STEPS * float(np.median(np.diff(t))) if len(t) > 1 else np.inf


def stretch_edges(t: NDArray[np.float64], max_gap: float | None = None) -> NDArray[np.intp]:
    """Return the first index of every stretch without a gap, and len(t) at the end.

    Args:
        t: increasing time, s, (N,).
        max_gap: longest step within a stretch, s; five median steps where None.
    """
    limit = default_gap(t) if max_gap is None else max_gap
    return np.concatenate([[0], np.flatnonzero(np.diff(t) > limit) + 1, [len(t)]]).astype(np.intp)


def stretches(
    t: NDArray[np.float64],
    valid: NDArray[np.bool_],
    max_gap: float | None = None,
    min_samples: int = 2,
    restarts: NDArray[np.intp] | None = None,
) -> list[slice]:
    """Return the slices of at least `min_samples` valid samples that no gap in time and no restart interrupts.

    Args:
        t: increasing time, s, (N,).
        valid: samples that count, (N,).
        max_gap: longest step within a stretch, s; five median steps where None.
        min_samples: shorter stretches are left out.
        restarts: samples with which a new stretch begins.
    """
    if len(t) == 0:
        return []
    limit = default_gap(t) if max_gap is None else max_gap
    joined = valid[1:] & valid[:-1] & (np.diff(t) <= limit)
    if restarts is not None:
        joined[restarts[(restarts > 0) & (restarts < len(t))] - 1] = False
    edges = np.flatnonzero(~joined) + 1
    starts = np.concatenate([[0], edges])
    stops = np.concatenate([edges, [len(t)]])
    keep = valid[starts] & (stops - starts >= min_samples)
    return [slice(int(a), int(b)) for a, b in zip(starts[keep], stops[keep], strict=True)]
