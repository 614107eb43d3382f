"""Fit explanations to a log and judge them on runs left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.measured_start import better_from_measured
from auvnn.diagnosis.hypotheses.outlier_restart import fit_with_outlier_restart
from auvnn.diagnosis.hypotheses.parts_first import better_from_parts
from auvnn.diagnosis.hypotheses.plausible_sizes import departure, sizes_of
from auvnn.diagnosis.hypotheses.standard_errors import of_timing
from auvnn.diagnosis.hypotheses.stated_priors import (
    Layout,
    correlation_root,
    priors,
    scales,
    shapes,
)
from auvnn.estimation.prediction_error import Fitted
from auvnn.estimation.priors import Priors
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Runs left out at a time where there are many, and stretches where there is one run only.
FOLDS = 5


@dataclass(frozen=True)
class FittedHypothesis:
    """A set of effects fitted jointly with what is uncertain.

    Attributes:
        effects: what is supposed to be missing.
        fitted: the fit.
        names: effects whose parameters were free, in order of their columns.
        evidence: logarithm of the marginal likelihood, up to a constant that all explanations share.
        left_out: (B,) weighted squared error of each window, fitted without its fold.
        left_out_count: (B,) samples of each window.
        misfit: the part of minus twice the evidence that is fit: squared error and departure from what was stated.
        judged: what is assumed of the parameters where something is left out; as in the fit by default.
        under_law: the fit with sums under the law of a stochastic force, in the sensors' white noise; standard errors
            follow from these. None without a force.
        around: trajectories (B, L, 13) about which its windows are linear under a law; None for free running.
        systematic: (P,) how far its parameters may be off for what no fit to this log tells: when within an interval a
            command acts, and explanations that the data prefer and that are not named; None where that is nothing.
        beside: effects without a name that the log asks for beside these, and that `systematic` allows for.
    """

    effects: tuple[str, ...]
    fitted: Fitted
    names: tuple[str, ...]
    evidence: float
    left_out: Array
    left_out_count: Array
    misfit: float = 0.0
    judged: Priors | None = None
    under_law: Fitted | None = None
    around: Tensor | None = None
    systematic: Array | None = None
    beside: tuple[str, ...] = ()

    @property
    def cv(self) -> float:
        """Root-mean-square weighted error on what was left out; one is noise alone."""
        return float(np.sqrt(self.left_out.sum() / max(self.left_out_count.sum(), 1.0)))

    def squared_error(self, sigma: Array) -> float:
        """Return the squared error of free running by weights that all explanations of a log share, sigma (18,)."""
        seen = np.isfinite(sigma)
        return float((self.fitted.statistics.channel.sum(0)[seen] / sigma[seen] ** 2).sum())


def folds(run: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the fold of windows of these runs, (B,): by run where there are several, else by stretch of time."""
    runs = np.unique(run)
    if len(runs) >= 2:
        return np.searchsorted(runs, run) % FOLDS
    return (np.arange(len(run)) * min(FOLDS, len(run)) // max(len(run), 1)).astype(np.int64)


def plausible(
    layout: Layout, names: Sequence[str], effects: Sequence[str], held: Priors, theta: Array
) -> Priors:
    """Return the priors of a fit with the effects asked for within what is plausible of them.

    What is left out may be all that says anything of a parameter. It is then not predicted anywhere, but where the
    evidence looks for it too; a shape near where it was found.

    Args:
        layout: stated values and plausible sizes.
        names: effects that are free, in the order of `theta`.
        effects: those of them that were asked for.
        held: priors of the fit on everything.
        theta: where it ended, (P,).
    """
    mean, precision = held.mean.copy(), held.precision.copy()
    joint = None if held.joint is None else held.joint.copy()
    for name, own in layout.places(names).items():
        if name in effects:
            precision[own] = np.maximum(precision[own], scales(layout, name) ** -2.0)
            mean[own] = np.where(shapes(layout, name), theta[own], mean[own])
            if joint is not None:
                # What was asked for goes together with nothing that was known before.
                joint[own, own] = precision[own]
    return replace(held, mean=mean, precision=precision, joint=joint)


def left_out(statistics: Statistics, theta: Array, held: Priors, fold: NDArray[np.int64]) -> Array:
    """Return each window's weighted squared error under parameters fitted without its fold, (B,).

    The fit is linear about the fit on everything, from the windows' own sums: no run is simulated again.

    Args:
        statistics: sums of every window at the fit on everything.
        theta: that fit, (P,).
        held: its priors.
        fold: of each window, (B,).

    Raises:
        numpy.linalg.LinAlgError: free running grows without bound, so that the sums cannot be solved.
    """
    cost = np.empty(len(fold))
    free = held.inside(theta)
    # The solver would say so as well, but LAPACK writes of it to the terminal first.
    if free.any() and not (np.isfinite(statistics.hessian).all() and np.isfinite(statistics.slope).all()):
        raise np.linalg.LinAlgError("free running grows without bound")
    for f in np.unique(fold):
        keep = fold != f
        if not keep.any():
            keep = fold == f
        hessian = statistics.hessian[keep].sum(0) + held.square
        gradient = statistics.slope[keep].sum(0) - held.pull(theta)
        step = np.zeros(len(theta))
        if free.any():
            step[free] = np.linalg.lstsq(hessian[np.ix_(free, free)], gradient[free], rcond=1e-12)[0]
        out = ~keep if (~keep).any() else keep
        cost[out] = (
            statistics.cost[out]
            - 2 * statistics.slope[out] @ step
            + np.einsum("i,bij,j->b", step, statistics.hessian[out], step)
        )
    return cost


def fit_hypothesis(
    layout: Layout,
    windows: Windows,
    base: Sequence[str],
    effects: Sequence[str],
    *,
    start: Fitted | None = None,
    guess: Layout | None = None,
    sigma: Array | None = None,
    iterations: int = 15,
) -> FittedHypothesis:
    """Fit effects jointly with the base and judge them on folds left out.

    Args:
        layout: stated values and columns.
        windows: of the log.
        base: effects that are free anyway: stated uncertainties and effects found before.
        effects: effects asked for; a stated uncertainty among them is set free.
        start: a fit whose initial states and weights to start from.
        guess: a layout whose model holds values to start from.
        sigma: fixed weights; estimated where absent.
        iterations: at most this many steps of the fit.

    Raises:
        FitError: the fit has nowhere to begin.
    """
    names = tuple(dict.fromkeys([*base, *effects]))
    held = priors(layout, names, free=effects)
    model = (guess or layout).model
    initial = None if start is None else start.initial
    fitted = fit_with_outlier_restart(
        model, windows, names, held, iterations=iterations, initial=initial, sigma=sigma
    )
    if initial is not None:
        fitted = better_from_measured(
            fitted, model, windows, names, held, initial=initial, sigma=sigma, iterations=iterations
        )
    fitted = better_from_parts(fitted, windows, names, held, sigma=sigma, iterations=iterations)
    judged = plausible(layout, names, effects, held, fitted.theta)
    cost = left_out(fitted.statistics, fitted.theta, judged, folds(windows.run))
    count = fitted.statistics.count[:, np.isfinite(fitted.sigma)].sum(1)
    timing = of_timing(fitted.model, names, windows)
    return FittedHypothesis(tuple(effects), fitted, names, 0.0, cost, count, judged=judged, systematic=timing)


def log_evidence(layout: Layout, explanation: FittedHypothesis, factor: float) -> FittedHypothesis:
    """Return the explanation with its evidence: Laplace's approximation with priors of plausible size.

    Args:
        layout: stated values.
        explanation: to be weighed.
        factor: variance of the scores over that of white noise; divides the data's say.

    Reference: MacKay (1992), Neural Computation 4(3).
    """
    fitted, names, effects = explanation.fitted, explanation.names, explanation.effects
    # With nothing uncertain and nothing asked for, there is nothing to weigh but the data.
    size = sizes_of(layout, names, effects)
    information = fitted.statistics.total * size[:, None] * size / factor
    root = correlation_root(layout, names, effects)
    if root is not None:
        information = root.T @ information @ root
    data = float(fitted.statistics.cost.sum()) / factor
    volume = np.linalg.slogdet(information + np.eye(len(size)))[1]
    misfit = data + departure(layout, names, effects, fitted.theta)
    return replace(explanation, evidence=-0.5 * (misfit + volume), misfit=misfit)
