"""Bounded statistics of the missing wrench against the effects' sensitivities, and what they say about each kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Normal equations of the samples of a stretch, each degree of freedom for itself.

    Attributes:
        start: s, time of its first sample.
        count: samples.
        hessian: (6, P, P) sum of s s^T, s the slope of a degree of freedom's wrench.
        slope: (6, P) sum of s y, y the missing wrench.
        square: (6,) sum of y^2.
        total: (6,) sum of y.
        reach: (6, P) sum of s.
    """

    start: float
    count: float
    hessian: Array
    slope: Array
    square: Array
    total: Array
    reach: Array

    @classmethod
    def of(cls, start: float, slopes: Array, missing: Array) -> Block:
        """Return the block of samples with slopes (n, 6, P) and missing wrench (n, 6).

        Args:
            start: time of the first sample, s.
            slopes: of the wrench in the parameters, (n, 6, P).
            missing: wrench, N and N m, (n, 6).
        """
        return cls(
            start, float(len(missing)), np.einsum("nap,naq->apq", slopes, slopes),
            np.einsum("nap,na->ap", slopes, missing), (missing**2).sum(0), missing.sum(0),
            slopes.sum(0),
        )  # fmt: skip

    def weighted(self, variance: Array) -> tuple[Array, Array, float]:
        """Return hessian (P, P), slope (P,) and square, each degree of freedom by its inverse variance (6,)."""
        w = 1.0 / variance
        return np.tensordot(w, self.hessian, 1), w @ self.slope, float(w @ self.square)

    def without(self, theta: Array) -> Block:
        """Return the block with the part that parameters theta (P,) explain taken out."""
        carried = self.hessian @ theta
        square = self.square - 2.0 * self.slope @ theta + carried @ theta
        return Block(
            self.start, self.count, self.hessian, self.slope - carried, np.maximum(square, 0.0),
            self.total - self.reach @ theta, self.reach,
        )  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """One hypothesis fitted to a stretch.

    Attributes:
        theta: (p,) change of the parameters.
        covariance: (p, p) for noise of the assumed size.
        evidence: logarithm of the Bayes factor against no change.
        left: weighted sum of squares that it leaves.
    """

    theta: Array
    covariance: Array
    evidence: float
    left: float


def fit(hessian: Array, slope: Array, square: float, scale: Array, heat: float = 1.0) -> Fit:
    """Fit a linear hypothesis with a Gaussian prior of the plausible sizes.

    Args:
        hessian: (p, p).
        slope: (p,).
        square: sum of squares to explain, all in units of the noise.
        scale: (p,) plausible sizes of the parameters.
        heat: variance of what is taken for noise, in units of the assumed one.
    """
    unit = hessian * scale[:, None] * scale / heat
    along = slope * scale / heat
    precision = unit + np.eye(len(scale))
    covariance = np.linalg.inv(precision)
    theta = covariance @ along
    evidence = 0.5 * float(along @ theta) - 0.5 * float(np.linalg.slogdet(precision)[1])
    left = square - heat * float(2.0 * along @ theta - theta @ unit @ theta)
    return Fit(theta * scale, covariance * scale[:, None] * scale, evidence, max(left, 0.0))


def gains(hessians: Array, slopes: Array, scale: Array) -> Array:
    """Return the evidence of many stretches at once: (n, p, p) and (n, p) to (n,).

    Args:
        hessians: sums of squared slopes, (n, p, p), by inverse variance.
        slopes: sums of slopes times what is missing, (n, p), likewise.
        scale: plausible size of each parameter, (p,).
    """
    unit = hessians * scale[:, None] * scale
    along = slopes * scale
    precision = unit + np.eye(len(scale))
    theta = np.linalg.solve(precision, along[..., None])[..., 0]
    return 0.5 * (along * theta).sum(-1) - 0.5 * np.linalg.slogdet(precision)[1]
