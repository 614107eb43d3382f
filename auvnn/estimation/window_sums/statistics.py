"""What is left of each window once its initial state is projected out: the sums that fits and tests rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from auvnn.estimation.window_sums.kept_products import KeptProducts

Array = NDArray[np.float64]
# Sums beyond this are those of windows whose sensitivities have grown without bound.
HUGE = 1e60


@dataclass(frozen=True)
class Statistics:
    """Sums of weighted windows after the initial state is projected out, one entry per window.

    Attributes:
        hessian: (B, P, P), J^T J.
        slope: (B, P), J^T e.
        cost: (B,), e^T e.
        channel: (B, 18) sum of squared errors in SI units.
        count: (B, 18) samples.
        rough: (B, 18) sum of squared differences of successive errors: noise without the slow part.
        pairs: (B, 18) differences.
        run: (B,) run numbers.
        first: (B,) index of the first sample.
        spent: (B, 18) degrees of freedom that initial state and stochastic force have taken; None without a force.
        volume: (B,) logarithm of the determinant of what the data say about both; None without a force.
        products: what is kept in the place of `hessian`, which is empty then; None where it is there.
    """

    hessian: Array
    slope: Array
    cost: Array
    channel: Array
    count: Array
    rough: Array
    pairs: Array
    run: NDArray[np.int64]
    first: NDArray[np.int64]
    spent: Array | None = None
    volume: Array | None = None
    products: KeptProducts | None = None

    @cached_property
    def total(self) -> Array:
        """J^T J of all windows, (P, P)."""
        return self.hessian.sum(0) if self.products is None else self.products.whole

    def block(self, columns: NDArray[np.int64]) -> Array:
        """Return J^T J of each window for some of the parameters, (B, k, k)."""
        kept = self.products
        return self.hessian[:, columns[:, None], columns] if kept is None else kept.block(columns)

    def columns(self, chosen: Sequence[int]) -> Statistics:
        """Return the same statistics for some of the parameters."""
        index = np.asarray(chosen, dtype=int)
        return replace(self, hessian=self.hessian[:, index[:, None], index], slope=self.slope[:, index])

    def finite(self) -> Statistics:
        """Return the same with nothing said of parameters whose sums are not finite: no test finds them."""
        whole, slope = self.total, self.slope.sum(0)
        with np.errstate(invalid="ignore"):
            bad = ~np.isfinite(np.diag(whole)) | ~np.isfinite(slope) | (np.abs(np.diag(whole)) > HUGE)
        if not bad.any():
            return self
        hessian, slopes = self.hessian.copy(), self.slope.copy()
        if self.products is not None:
            slopes[:, bad] = 0.0
            return replace(self, slope=slopes, products=self.products.without(bad))
        hessian[:, bad], hessian[:, :, bad], slopes[:, bad] = 0.0, 0.0, 0.0
        return replace(self, hessian=np.nan_to_num(hessian), slope=slopes)

    def after(self, step: Array) -> Statistics:
        """Return the same after a short step of the parameters, (P,), as far as they are linear in it."""
        taken = self.hessian @ step
        cost = self.cost - 2.0 * self.slope @ step + taken @ step
        return replace(self, slope=self.slope - taken, cost=cost)

    def noise(self) -> Array:
        """Return each channel's white noise, (18,), from successive differences of the errors; NaN unmeasured."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(self.rough.sum(0) / (2 * self.pairs.sum(0)))
