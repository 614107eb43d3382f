"""Standard errors of fitted parameters: what the fit leaves open, and what no fit to this log tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import DETERMINED
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

if TYPE_CHECKING:
    from auvnn.diagnosis.hypotheses.fit import FittedHypothesis

Array = NDArray[np.float64]
# Share by which rounding may take a variance below what it must be, and the relative standard error below which no log
# determines a value.
ROUNDING, RESOLVED = 1e-3, 1e-9
TINY = 1e-300
# Standard errors within which an amount may be null, and is known for one value of its shape alone.
NEAR_NULL = 3.0


def determined(explanation: FittedHypothesis, columns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether the log says more of some parameters than their priors do, by sums that can be right.

    Where an amount may be null the log says nothing of its shape, and its variance holds for the one shape that the fit
    happens to have: a cable that is never taut may be of any stiffness (Davies 1977, Biometrika 64(2)).

    Args:
        explanation: a fit.
        columns: positions within its own parameter vector.
    """
    fitted = explanation.under_law or explanation.fitted
    variance = np.diag(fitted.covariance())
    known = np.diag(fitted.statistics.total + fitted.priors.square)
    told = variance * fitted.priors.precision < DETERMINED**2
    told &= is_possible(variance, known, fitted.theta)
    for at, null in _with_shapes_of_their_own(fitted.model, explanation.names):
        told[at] &= abs(fitted.theta[at] - null) >= NEAR_NULL * np.sqrt(max(variance[at], 0.0))
    return told[columns]


def _with_shapes_of_their_own(model: GreyBox, names: Sequence[str]) -> list[tuple[int, float]]:
    """Return where amounts stand without which a shape says nothing, and their nulls."""
    described = [(name, p) for name in names for p in model.effect(name).parameters_of]
    needed = {(name, p.of) for name, p in described if p.of}
    return [(at, p.null) for at, (name, p) in enumerate(described) if (name, p.name) in needed]


def standard_errors(explanation: FittedHypothesis, columns: NDArray[np.int64]) -> tuple[Array, float]:
    """Return standard errors of some parameters, and the inflation that went into them.

    A parameter that is not `determined` has none: NaN. What lies between explanations, and between samples, is part of
    them.

    Args:
        explanation: a fit.
        columns: positions within its own parameter vector.
    """
    fitted = explanation.under_law or explanation.fitted
    statistics = fitted.statistics
    covariance = fitted.covariance()
    others = np.setdiff1d(np.arange(len(fitted.theta)), columns)
    whole = NormalEquations(statistics.total + fitted.priors.square, statistics.slope.sum(0))
    left = whole.eliminate(columns, others, rcond=1e-12)
    by_window = left.scores(statistics.slope[:, columns], statistics.slope[:, others])
    factor = variance_inflation(by_window, left.equations.square, statistics.run)
    variance = np.maximum(np.diag(covariance)[columns], 0.0) * factor
    if explanation.systematic is not None:
        variance = variance + explanation.systematic[columns] ** 2
    return np.where(determined(explanation, columns), np.sqrt(variance), np.nan), factor


def of_timing(model: GreyBox, names: Sequence[str], windows: Windows) -> Array | None:
    """Return how far delays may be off because a log does not tell when within an interval a command acts, (P,).

    The standard deviation of a uniform distribution over an interval between samples; zero for all other parameters,
    None where there is none of these.

    Args:
        model: with the effects.
        names: of effects, in the order of the parameters.
        windows: of the log.
    """
    delays = np.array([p.timing for name in names for p in model.effect(name).parameters_of], dtype=bool)
    if not delays.any():
        return None
    interval = float(windows.times.diff(dim=-1).nanmedian())
    return np.where(delays, interval / np.sqrt(12.0), 0.0)


def is_possible(variance: Array, information: Array, value: Array) -> NDArray[np.bool_]:
    """Return whether variances can be those of estimates.

    A variance is never less than the inverse of what is known with all other parameters given. Where sums are singular,
    their generalised inverse is; and where a stiff model lets slopes grow from step to step, they say that a value is
    known to the last digits.

    Args:
        variance: of the estimates, (p,).
        information: on the diagonal of the normal equations, (p,).
        value: of the estimates, (p,).
    """
    least = np.maximum((1.0 - ROUNDING) / np.maximum(information, TINY), (RESOLVED * value) ** 2)
    return variance > least
