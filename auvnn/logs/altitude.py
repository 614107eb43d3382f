"""The height above the bottom without the altimeter's noise, at the samples and over the intervals between them.

A force that falls steeply with the height looks weaker and less steep where the height that drives it has noise (errors
in variables): near the bottom two centimetres are a tenth of the height. What a fit needs is the height itself, and the
vehicle's own motion says how it changes from sample to sample: with the depth that the velocities add up to,

    bottom(t) = altitude(t) + integral of the rate of descent,

changes only as the bottom under the vehicle does, and slowly with what is wrong with the velocities. It is smoothed by
local parabolas over the width that predicts samples best that are left out, and the integral is taken off again.

Reference: Savitzky and Golay (1964), Analytical Chemistry 36(8), for local polynomials; Stone (1974), Journal of the
Royal Statistical Society B 36(2), for the choice by samples that are left out; Carroll, Ruppert, Stefanski and
Crainiceanu (2006), Measurement error in nonlinear models, chapter 4, for the regression on what is known of an input
with noise.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from auvnn.logs.run import Run
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.logs.signals.outliers import spikes
from auvnn.logs.signals.repeats import repeats
from auvnn.logs.signals.segments import default_gap

Array = NDArray[np.float64]
# Samples on either side that a parabola may be fitted to.
WIDTHS = (2, 4, 8, 16, 32, 64, 128)
# So many samples say which width is best; of a longer run its middle does.
ENOUGH = 10_000
# A run has its height worked out once, however often it is cut into windows.
_KNOWN: WeakKeyDictionary[Run, Array | None] = WeakKeyDictionary()


def altitude_at_samples(run: Run) -> Array | None:
    """Return the height above the bottom at each sample, m, (N,); None where none was measured.

    Single-sample outliers and values that stand for more than one sample are left out, and gaps are bridged by the
    vehicle's own motion.

    Args:
        run: of a log.
    """
    if run not in _KNOWN:
        _KNOWN[run] = _worked_out(run)
    return _KNOWN[run]


def altitude_over_intervals(run: Run) -> Array | None:
    """Return the height about the middle of the interval after each sample, m, (N,); None where none was measured.

    Over a gap, and at the end, it is the height at the sample.

    Args:
        run: of a log.
    """
    at = altitude_at_samples(run)
    if at is None:
        return None
    middle = np.append(0.5 * (at[1:] + at[:-1]), at[-1])
    return np.where(np.append(np.diff(run.t), 0.0) > default_gap(run.t), at, middle)


def _worked_out(run: Run) -> Array | None:
    measured = run.altitude
    if measured is None:
        return None
    seen = np.isfinite(measured) & ~repeats(measured[:, None]) & ~spikes(measured)
    if not seen.any():
        return run.filled("altitude")
    sunk = _sunk(run)
    bottom = _smoothed(run.t[seen], measured[seen] + sunk[seen])
    return np.asarray(np.interp(run.t, run.t[seen], bottom) - sunk)


def _sunk(run: Run) -> Array:
    """Return how far the velocities say that the vehicle has gone down since the first sample, m, (N,)."""
    w, x, y, z = run.quaternion.T
    down = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=-1)
    rate = (down * run.nu[:, :3]).sum(-1)
    known = np.isfinite(rate)
    if not known.any():
        return np.zeros(run.samples)
    return np.asarray(cumulative_trapezoid(np.interp(run.t, run.t[known], rate[known]), run.t, initial=0.0))


def _smoothed(t: Array, values: Array) -> Array:
    """Return a signal smoothed over the width that predicts samples best that are left out, (N,).

    Args:
        t: s, (N,).
        values: without gaps, (N,).
    """
    half = _width(t, values)
    if not half:
        return values
    smooth = LocalPolynomial(t, half)(values)[0]
    return np.where(np.isfinite(smooth), smooth, values)


def _width(t: Array, values: Array) -> int:
    """Return the samples on either side that say most of one that is left out; 0 where it is told best by itself.

    A median of the errors is compared, so that a few samples that are wrong do not decide.
    """
    first = max(0, (len(t) - ENOUGH) // 2)
    t, values = t[first : first + ENOUGH], values[first : first + ENOUGH]
    best, least = 0, np.inf
    for half in WIDTHS:
        if 2 * half + 1 > len(t):
            break
        smoother = LocalPolynomial(t, half)
        own = smoother.smoothing[np.arange(len(t)), np.arange(len(t)) - smoother.start]
        with np.errstate(invalid="ignore"):
            left_out = np.abs(values - smoother(values)[0]) / np.maximum(1.0 - own, 1e-9)
        error = float(np.nanmedian(left_out)) if np.isfinite(left_out).any() else np.inf
        # White noise of the same size everywhere has the wider of two widths that do equally well.
        if error <= least:
            best, least = half, error
    return best
