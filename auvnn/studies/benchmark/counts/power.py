"""How small an effect may be and still be found nine times in ten: a logistic curve over the logarithm of its size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from auvnn.studies.benchmark.counts.entries import SmallestFound

Array = NDArray[np.float64]

POWER = 0.9
# A factor of two either way, in logarithms, is as uncertain as a size may be and still be called determined.
LOOSEST = float(np.log(2.0))
FEWEST = 6


def smallest_found(sizes: Sequence[float], found: Sequence[bool]) -> SmallestFound:
    """Return the size at which an effect is found with a chance of 90 %.

    P(found) = 1 / (1 + exp(-(a + b ln size))), fitted with Jeffreys' prior as a penalty, so that the curve stays
    finite where small effects are never found and larger ones always.

    Args:
        sizes: of the effects, in standard errors (or stated uncertainties), one for each log.
        found: whether it was found.

    Returns:
        `size` with `low` and `high`, the ends of its 95 % interval; `determined`; and `words` that say why it is
        not, or between which sizes it lies. `size` is None where there is no such curve.

    References:
        Firth (1993), Biometrika 80(1), for the penalty; Heinze and Schemper (2002), Statistics in Medicine 21.
    """
    x, y = np.log(np.asarray(sizes, dtype=float)), np.asarray(found, dtype=float)
    nothing: SmallestFound = {
        "size": None, "low": None, "high": None, "determined": False, "logs": len(y), "words": "",
    }  # fmt: skip
    tried = np.unique(x)
    if len(y) < FEWEST or len(tried) < 2:
        return {**nothing, "words": "too few logs or sizes"}
    share = np.array([y[x == size].mean() for size in tried])
    smallest, largest = (f"{np.exp(end):.3g}" for end in (tried[0], tried[-1]))
    if share[0] >= POWER:
        return {**nothing, "words": f"at most {smallest}, the smallest tried"}
    if share[-1] < POWER:
        return {**nothing, "words": f"more than {largest}, the largest tried"}
    centre = x.mean()
    a, b, covariance = _firth(x - centre, y)
    if b <= 0:
        return {**nothing, "words": "larger effects are not found more often"}
    wanted = np.log(POWER / (1 - POWER))
    at = (wanted - a) / b
    slope = np.array([-1.0 / b, -at / b])
    std = float(np.sqrt(slope @ covariance @ slope))
    size, low, high = (float(np.exp(centre + at + k * 1.96 * std)) for k in (0, -1, 1))
    inside = tried[0] <= centre + at <= tried[-1]
    above = tried[share >= POWER].min()
    below = tried[tried < above].max(initial=tried[0])
    words = f"between {np.exp(below):.3g} and {np.exp(above):.3g}"
    if not inside:
        words = "outside the sizes tried"
    return {
        "size": size, "low": low, "high": high, "determined": bool(inside and std < LOOSEST), "logs": len(y),
        "words": words,
    }  # fmt: skip


def _firth(x: Array, y: Array) -> tuple[float, float, Array]:
    """Return intercept, slope and their covariance of a logistic curve with Jeffreys' prior."""
    design = np.column_stack([np.ones_like(x), x])

    def information(theta: Array) -> Array:
        p = expit(design @ theta)
        return design.T @ (design * (p * (1 - p))[:, None])

    def cost(theta: Array) -> float:
        line = design @ theta
        # log(1 + exp(line)) without overflow.
        likelihood = float(y @ line - np.logaddexp(0.0, line).sum())
        return -likelihood - 0.5 * float(np.linalg.slogdet(information(theta) + 1e-12 * np.eye(2))[1])

    theta = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9}).x
    return float(theta[0]), float(theta[1]), np.linalg.pinv(information(theta)).astype(np.float64)
