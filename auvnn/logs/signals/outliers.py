"""Single-sample spikes: values that leave their neighbours and come straight back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NORMAL = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
_LIMIT = 10.0


def spikes(y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask of isolated spikes.

    A spike stands out from the mean of its neighbours, e_i = y_i - (y_{i-1} + y_{i+1}) / 2, by more than
    ten robust standard deviations of e, and the neighbours stand out by about half as much to the other
    side. The second condition spares steps and kinks, which real motion has.

    Args:
        y: signal, (N,); NaN is missing and never a spike.

    Returns:
        Mask (N,).
    """
    mask = np.zeros(len(y), dtype=bool)
    if len(y) < 9:
        return mask
    bend = np.full(len(y), np.nan)
    bend[1:-1] = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    finite = np.isfinite(bend)
    if finite.sum() < 7:
        return mask
    spread = _NORMAL * np.median(np.abs(bend[finite]))
    # A held or noise-free signal has a spread of zero: ask for a visible share of its motion as well.
    threshold = max(_LIMIT * spread, 0.05 * float(np.nanstd(y)))
    if threshold == 0.0:
        return mask
    with np.errstate(divide="ignore", invalid="ignore"):
        before, after = -bend[1:-3] / bend[2:-2], -bend[3:-1] / bend[2:-2]
    shape = (before > 0.2) & (before < 0.8) & (after > 0.2) & (after < 0.8)
    mask[2:-2] = shape & (np.abs(bend[2:-2]) > threshold)
    return mask
