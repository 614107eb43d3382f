"""A smooth minimum within bounds by quasi-Newton steps, where the curvature is known roughly to begin with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from auvnn.estimation.priors import bounded_step

Array = NDArray[np.float64]
# Shares of a step that are tried, the share of what it promises that it must bring, and the longest step.
SHARES, BROUGHT, LONGEST = (1.0, 0.3, 0.1, 0.03, 0.01), 1e-4, 2.0
# Steps longer than this make the curvature be worked out anew.
FAR = 0.5


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

    Each step is the minimum of a quadratic within the bounds. Its curvature is that of `curved` at the start and after
    long steps, in between updated by the slopes (BFGS).

    Args:
        sloped: value and slope (P,) at a point (P,).
        curved: roughly the second derivatives there, (P, P), positive definite.
        start: where to begin, (P,), within the bounds.
        low: least values, (P,).
        high: largest values, (P,).
        most: steps.
        enough: what a step promises at least; where none does, that is the minimum.

    Reference: Nocedal and Wright (2006), Numerical Optimization, 2nd ed., chapters 6 and 18.
    """
    x, (value, slope), normal = start, sloped(start), curved(start)
    for _ in range(most):
        step = bounded_step(normal, -slope, np.maximum(low - x, -LONGEST), np.minimum(high - x, LONGEST))
        promised = -float(slope @ step + 0.5 * step @ normal @ step)
        if not promised >= enough:
            break
        for share in SHARES:
            at = np.clip(x + share * step, low, high)
            there, slope_there = sloped(at)
            if there <= value - BROUGHT * share * promised:
                break
        else:
            break
        moved, turned = at - x, slope_there - slope
        x, value, slope = at, there, slope_there
        normal = curved(x) if np.abs(moved).max() > FAR else _updated(normal, moved, turned)
    return value, x


def _updated(normal: Array, moved: Array, turned: Array) -> Array:
    """Return the curvature with what a step has shown of it; as it was where the slope has turned the wrong way."""
    along, seen = normal @ moved, float(moved @ turned)
    before = float(moved @ along)
    if seen <= 1e-3 * before:
        return normal
    return normal + np.outer(turned, turned) / seen - np.outer(along, along) / before
