"""Parameters of effects in a fit: their values in a model, what is assumed of them, and steps within their bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import lsq_linear

from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Share of the largest eigenvalue below which normal equations say nothing of a direction.
NEGLIGIBLE = 1e-13


@dataclass(frozen=True)
class Priors:
    """Normal priors of the P free parameters: `mean` and `precision` (zero where free), (P,); independent by default.

    Attributes:
        mean: (P,).
        precision: (P,), of each parameter by itself.
        reach: (P,) no parameter may leave its mean by more; infinite where there is no such limit.
        joint: (P, P) precision of all together, where some go together; None where they are independent.
    """

    mean: Array
    precision: Array
    reach: Array | None = None
    joint: Array | None = None

    @property
    def square(self) -> Array:
        """The precision of all parameters together, (P, P)."""
        return np.diag(self.precision) if self.joint is None else self.joint

    def pull(self, theta: Array) -> Array:
        """Return the slope of half the penalty at some values, (P,): the precision times how far they are off."""
        away = theta - self.mean
        return self.precision * away if self.joint is None else self.joint @ away

    def penalty(self, theta: Array) -> float:
        """Return what values (P,) cost: minus twice the logarithm of the prior, up to a constant."""
        away = theta - self.mean
        return float(self.precision @ away**2 if self.joint is None else away @ self.joint @ away)

    def extended_by(self, precision: Array) -> Priors:
        """Return the priors with further parameters of mean zero at the end, independent of these; without reach.

        Args:
            precision: of the further ones, (K,).
        """
        joint = None if self.joint is None else np.asarray(block_diag(self.joint, np.diag(precision)))
        mean = np.concatenate([self.mean, np.zeros(len(precision))])
        return Priors(mean, np.concatenate([self.precision, precision]), None, joint)

    def inside(self, theta: Array) -> NDArray[np.bool_]:
        """Return which parameters are within their reach rather than at its end, (P,)."""
        if self.reach is None:
            return np.ones(len(theta), dtype=bool)
        return np.abs(theta - self.mean) < self.reach * (1.0 - 1e-6)


def parameters_of(model: GreyBox, names: Sequence[str]) -> Array:
    """Return the values of the named effects' parameters, joined, (P,)."""
    parts = [model.effect(n).theta.detach().cpu().numpy() for n in names]
    return np.concatenate(parts) if parts else np.zeros(0)


def set_parameters(model: GreyBox, names: Sequence[str], theta: Array) -> None:
    """Set the values of the named effects' parameters, clipped to their bounds.

    Args:
        model: that is changed.
        names: of effects, in the order of `theta`.
        theta: their parameters side by side, SI units, (P,).
    """
    at = 0
    with torch.no_grad():
        for name in names:
            effect = model.effect(name)
            size = len(effect.parameters_of)
            low = [p.low for p in effect.parameters_of]
            high = [p.high for p in effect.parameters_of]
            effect.theta.copy_(torch.as_tensor(np.clip(theta[at : at + size], low, high)))
            at += size


def limits(model: GreyBox, names: Sequence[str], priors: Priors) -> tuple[Array, Array]:
    """Return least and largest values of the named effects' parameters, (P,) each: their bounds, within reach.

    Args:
        model: with the effects.
        names: of effects, in the order of the parameters.
        priors: with how far from its mean each may go, or None.
    """
    described = [p for name in names for p in model.effect(name).parameters_of]
    low = np.array([p.low for p in described], dtype=float)
    high = np.array([p.high for p in described], dtype=float)
    if priors.reach is not None:
        low, high = np.maximum(low, priors.mean - priors.reach), np.minimum(high, priors.mean + priors.reach)
    return low, high


def bounded_step(normal: Array, gradient: Array, low: Array, high: Array) -> Array:
    """Return the step that minimises x^T N x / 2 - g^T x between `low` and `high`, all (P,) but N (P, P).

    Where the free minimum is out of range, bounded-variable least squares. Putting what is out of range at its end and
    solving for the others is no minimum: where parameters are correlated it may be worse than no step at all.

    Args:
        normal: N, positive definite or nearly so, (P, P); what it says nothing of stays where it is.
        gradient: g, (P,).
        low: least steps, (P,).
        high: largest steps, (P,).

    Reference: Stark and Parker (1995), Computational Statistics 10(2) 129-141.
    """
    step: Array = np.asarray(np.linalg.lstsq(normal, gradient, rcond=NEGLIGIBLE)[0], dtype=float)
    if bool(((low <= step) & (step <= high)).all()):
        return step
    step = np.clip(0.0, low, high)
    free = low < high
    values, vectors = np.linalg.eigh(normal[np.ix_(free, free)])
    told = values > NEGLIGIBLE * values.max(initial=0.0)
    if not told.any():
        return step
    root, vectors = np.sqrt(values[told]), vectors[:, told]
    right = vectors.T @ (gradient[free] - normal[np.ix_(free, ~free)] @ step[~free]) / root
    found = lsq_linear(root[:, None] * vectors.T, right, (low[free], high[free]), method="bvls")
    step[free] = np.clip(found.x, low[free], high[free])
    return step
