"""Normal equations: solved in each parameter's own unit, and nuisance parameters eliminated.

Coefficients, thrusts, drags and onsets have units of their own: without scaling, what is hardly known would pass for
rounding beside what is well known. Nuisance parameters follow the others by `carry`; what is left is a Schur
complement.

Reference: Frisch and Waugh (1933), Econometrica 1(4), for the elimination.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from auvnn.estimation.priors import bounded_step
from auvnn.estimation.scaling import unit_of

Array = NDArray[np.float64]
Columns = NDArray[Any]


@dataclass(frozen=True)
class NormalEquations:
    """S x = r, what is known beforehand included.

    Attributes:
        square: S, J^T J and the priors' precision, (P, P).
        right: r, J^T e and the priors' pull, (P,).
    """

    square: Array
    right: Array

    @classmethod
    def with_priors(cls, square: Array, slope: Array, precision: Array, away: Array) -> NormalEquations:
        """Return the equations of a step, held by priors.

        Args:
            square: J^T J, (P, P).
            slope: J^T e, (P,).
            precision: of the priors, (P,), or (P, P) where some go together.
            away: how far the parameters are from the priors' means, (P,).
        """
        if precision.ndim == 2:
            return cls(square + precision, slope - precision @ away)
        return cls(square + np.diag(precision), slope - precision * away)

    def part(self, columns: Columns) -> NormalEquations:
        """Return the equations of some of the parameters, the others held where they are."""
        return NormalEquations(self.square[np.ix_(columns, columns)], self.right[columns])

    @property
    def scaled(self) -> tuple[Array, Array]:
        """S in units in which its diagonal is one, and these units, (P,); zero where S says nothing."""
        unit = unit_of(self.square)
        return self.square * unit[:, None] * unit, unit

    def solve(self, *, damping: float = 0.0, rcond: float = 1e-12) -> Array:
        """Return x, (P,), by least squares; zero where S says nothing.

        Args:
            damping: added to the scaled diagonal (Levenberg and Marquardt).
            rcond: singular values below this share of the largest say nothing.
        """
        even, unit = self.scaled
        even = even + damping * np.eye(len(unit)) if damping else even
        return np.linalg.lstsq(even, self.right * unit, rcond=rcond)[0] * unit

    def bounded(self, low: Array, high: Array, *, damping: float = 0.0) -> Array:
        """Return the minimum of x^T S x / 2 - r^T x between bounds, (P,).

        Args:
            low: least values, (P,); may be minus infinity.
            high: largest values, (P,); may be infinity.
            damping: added to the scaled diagonal (Levenberg and Marquardt).
        """
        even, unit = self.scaled
        even = even + damping * np.eye(len(unit)) if damping else even
        scale = 1.0 / np.where(unit > 0.0, unit, 1.0)
        return bounded_step(even, self.right * unit, low * scale, high * scale) * unit

    def gain(self, step: Array) -> float:
        """Return by how much a step, (P,), lowers the squared error: 2 r^T x - x^T S x."""
        return float(2.0 * self.right @ step - step @ self.square @ step)

    def covariance(self) -> Array:
        """Return the inverse of S, (P, P); zero where S says nothing."""
        even, unit = self.scaled
        return np.linalg.pinv(even, hermitian=True) * unit[:, None] * unit

    def solve_with_determinant(self) -> tuple[Array, float]:
        """Return x, (P,), and the logarithm of the determinant of S; what S says nothing of counts as one."""
        even, unit = self.scaled
        dead = np.flatnonzero(unit == 0.0)
        even[dead, dead] = 1.0
        right = self.right * unit
        scale = 2.0 * float(np.log(unit[unit > 0.0]).sum())
        try:
            factor = np.linalg.cholesky(even)
        except np.linalg.LinAlgError:
            solved = np.linalg.lstsq(even, right, rcond=1e-12)[0]
            return solved * unit, float(np.linalg.slogdet(even)[1]) - scale
        solved = cho_solve((factor, True), right, check_finite=False)
        return solved * unit, 2.0 * float(np.log(np.diagonal(factor)).sum()) - scale

    def eliminate(self, own: Columns, others: Columns, *, rcond: float | None = None) -> Eliminated:
        """Return the equations of some parameters, others following them as they fit best.

        Args:
            own: the parameters that are asked for, p of them.
            others: nuisance parameters, f of them; S must be positive definite in them where `rcond` is None.
            rcond: singular values below this share of the largest say nothing.
        """
        across = self.square[np.ix_(others, own)]
        carry = carry_of(self.square[np.ix_(others, others)], across, rcond=rcond)
        left = self.square[np.ix_(own, own)] - carry @ across
        return Eliminated(carry, NormalEquations(left, self.right[own] - carry @ self.right[others]))


@dataclass(frozen=True)
class Eliminated:
    """What is left of some parameters once nuisance parameters have taken their share.

    Attributes:
        carry: how the scores of the nuisance parameters go into theirs, (p, f); these parameters follow a step x by
            minus its transpose times x.
        equations: of what is left.
    """

    carry: Array
    equations: NormalEquations

    @property
    def information(self) -> Array:
        """S of what is left, symmetric to the last bit, (p, p)."""
        return 0.5 * (self.equations.square + self.equations.square.T)

    def scores(self, own: Array, others: Array) -> Array:
        """Return scores with the share of the nuisance parameters taken out, (B, p).

        Args:
            own: of the parameters, (B, p).
            others: of the nuisance parameters, (B, f).
        """
        return own - others @ self.carry.T


def carry_of(inner: Array, across: Array, *, rcond: float | None = None) -> Array:
    """Return how the scores of nuisance parameters go into those of others, (p, f).

    Args:
        inner: S of the nuisance parameters, (f, f).
        across: S between them and the others, (f, p).
        rcond: singular values below this share of the largest say nothing; None: S is positive definite.
    """
    if not len(inner):
        return np.zeros((across.shape[1], 0))
    if rcond is None:
        return np.asarray(np.linalg.solve(inner, across).T, dtype=np.float64)
    return np.asarray(np.linalg.lstsq(inner, across, rcond=rcond)[0].T, dtype=np.float64)
