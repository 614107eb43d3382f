"""A smooth minimum within bounds by quasi-Newton steps in a trust region, where the curvature is known roughly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from auvnn.estimation.priors import bounded_step

Array = NDArray[np.float64]
# The longest step in any direction, the share of what a step promises that it must bring, and the failures in a row that
# end the search.
LONGEST, BROUGHT, FAILURES = 2.0, 1e-4, 8
# Steps longer than this make the curvature be worked out anew.
FAR = 0.5
# A step that brings more than so much of what it promised lets the next be twice as long, one that brings less than so
# little shortens the next to such a share of it, and one that brings nothing to such a share.
GOOD, POOR, SHORTER, FAILED = 0.75, 0.25, 0.7, 0.5


def bounded_minimum(
    sloped: Callable[[Array], tuple[float, Array]],
    curved: Callable[[Array], Array],
    start: Array,
    low: Array,
    high: Array,
    *,
    most: int,
    enough: float,
) -> tuple[float, Array]:
    """Return the smallest value that steps lead to, and where.

    Each step is the minimum of a quadratic within the bounds and within a distance in each direction, which follows how
    well the quadratic has foretold the value. Its curvature is that of `curved` at the start and after long steps, else
    updated by the slopes (BFGS), by those of a step that failed too: it shows how much more the value is curved there.

    Args:
        sloped: value and slope (P,) at a point (P,).
        curved: roughly the second derivatives there, (P, P), positive definite.
        start: where to begin, (P,), within the bounds.
        low: least values, (P,).
        high: largest values, (P,).
        most: steps, those that fail too.
        enough: what a step promises at least. The search ends where the next one promises less, within the distance that
            it may go: after steps that failed this may be a little above the minimum.

    Reference: Nocedal and Wright (2006), Numerical Optimization, 2nd ed., chapters 4 (trust regions), 6 and 18.
    """
    x, (value, slope), normal = start, sloped(start), curved(start)
    reach, failures = LONGEST, 0
    for _ in range(most):
        step = bounded_step(normal, -slope, np.maximum(low - x, -reach), np.minimum(high - x, reach))
        promised = -float(slope @ step + 0.5 * step @ normal @ step)
        if not promised >= enough:
            break
        at = np.clip(x + step, low, high)
        there, slope_there = sloped(at)
        moved, turned, brought = at - x, slope_there - slope, (value - there) / promised
        length = float(np.abs(moved).max())
        if not brought >= BROUGHT:
            failures += 1
            if failures == FAILURES:
                break
            reach, normal = FAILED * length, _updated(normal, moved, turned)
            continue
        failures, x, value, slope = 0, at, there, slope_there
        normal = curved(x) if length > FAR else _updated(normal, moved, turned)
        if brought > GOOD:
            reach = min(max(reach, 2.0 * length), LONGEST)
        elif brought < POOR:
            reach = SHORTER * length
    return value, x


def _updated(normal: Array, moved: Array, turned: Array) -> Array:
    """Return the curvature with what a step has shown of it; as it was where the slope has turned the wrong way."""
    along, seen = normal @ moved, float(moved @ turned)
    before = float(moved @ along)
    if not 1e-3 * before < seen < np.inf:
        return normal
    return normal + np.outer(turned, turned) / seen - np.outer(along, along) / before
