"""Does a parameter change from dive to dive? Constancy by chi-square, a trend by weighted regression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trend:
    """What values with standard errors say together.

    Attributes:
        count: values that count.
        mean: weighted mean.
        mean_std: its standard error, if the value is one and the same.
        chi2: weighted squared departures from the mean.
        constant_p: probability of so large a chi2 if the value is one and the same; NaN for fewer than two.
        slope: per unit of x; NaN for fewer than three, or where all x are one.
        slope_std: its standard error, scaled up by the scatter about the line where that is larger than stated.
        slope_p: probability of so large a slope, either way, if there is none.
        middle: x at which `level` holds.
        level: value of the line there.
        level_std: its standard error.
        scatter: square root of chi-square about the line per degree of freedom; about the mean without a line.
    """

    count: int
    mean: float
    mean_std: float
    chi2: float
    constant_p: float
    slope: float
    slope_std: float
    slope_p: float
    middle: float
    level: float
    level_std: float
    scatter: float


def trend(x: ArrayLike, value: ArrayLike, std: ArrayLike) -> Trend:
    """Return what values at x with standard errors say; one without a standard error does not count.

    With w = 1 / std^2: mean = sum(w y) / sum(w), chi2 = sum(w (y - mean)^2) on n - 1 degrees of freedom; the line
    y = level + slope (x - middle) is fitted by the same weights. Where the values scatter about the line by more than
    their standard errors say, these are scaled up by that ratio (Birge), and never down.

    Args:
        x: date or number of each dive, (n,).
        value: (n,).
        std: (n,).

    Reference: Birge (1932), Physical Review 40; Bevington and Robinson (2003), sections 4 and 6.
    """
    x, y, s = (np.asarray(a, dtype=float) for a in (x, value, std))
    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(s) & (s > 0)
    x, y, weight = x[good], y[good], s[good] ** -2.0
    n, nan = len(y), float("nan")
    if n == 0:
        return Trend(0, *[nan] * 11)
    mean = float(weight @ y / weight.sum())
    mean_std = float(weight.sum() ** -0.5)
    chi2 = float(weight @ (y - mean) ** 2)
    constant_p = float(stats.chi2.sf(chi2, n - 1)) if n > 1 else nan
    middle = float(weight @ x / weight.sum())
    reach = float(weight @ (x - middle) ** 2)
    about = float(np.sqrt(chi2 / (n - 1))) if n > 1 else nan
    if n < 3 or reach <= 1e-18 * weight.sum() * max(middle**2, 1.0):
        return Trend(n, mean, mean_std, chi2, constant_p, nan, nan, nan, middle, mean, mean_std, about)
    slope = float(weight @ ((x - middle) * (y - mean)) / reach)
    left = float(weight @ (y - mean - slope * (x - middle)) ** 2)
    scatter = float(np.sqrt(left / (n - 2)))
    wider = max(scatter, 1.0)
    slope_std = wider * reach**-0.5
    # With scatter that was estimated the ratio has Student's distribution; with stated errors that hold, the normal.
    size = abs(slope) / slope_std
    slope_p = float(2 * (stats.t.sf(size, n - 2) if scatter > 1.0 else stats.norm.sf(size)))
    return Trend(
        n,
        mean,
        mean_std,
        chi2,
        constant_p,
        slope,
        slope_std,
        slope_p,
        middle,
        mean,
        wider * mean_std,
        scatter,
    )
