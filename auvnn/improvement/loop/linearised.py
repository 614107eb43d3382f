"""Free running linearised about one point: its error on folds left out, for any choice of what is free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.estimation.priors import Priors, set_parameters
from auvnn.improvement.free_run import FreeRunFit, normal_equations
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.state import State

Array = NDArray[np.float64]
Index = NDArray[np.intp]
# Windows that are linearised, at most.
WINDOWS = 120


@dataclass(frozen=True)
class Linearised:
    """Every window's normal equations at one point, in all P parameters.

    Attributes:
        begin: the point, (P,).
        hessian: (B, P, P).
        slope: (B, P).
        cost: (B,), robust squared error of each window.
        weight: of the priors, as in `FreeRunFit`.
        own: (B,) fold of each window.
        free: (B, F) whether it shares nothing with each fold.
        folds: their numbers, (F,).
    """

    begin: Array
    hessian: Array
    slope: Array
    cost: Array
    weight: float
    own: NDArray[np.int64]
    free: NDArray[np.bool_]
    folds: Sequence[int]

    @classmethod
    def at(cls, layout: Layout, names: Sequence[str], begin: Array, judge: Judge, state: State) -> Linearised:
        """Linearise the windows of a log, evenly thinned where there are many.

        Args:
            layout: with the model.
            names: effects whose parameters are the columns, in order.
            begin: the point, (P,).
            judge: windows and folds of the log.
            state: of which length the windows are, and how the priors are weighted.
        """
        model = layout.model.rebuilt(layout.model.copied_effects())
        set_parameters(model, names, begin)
        task, own, free = judge.task(state.recipe.seconds)
        if len(task.windows) > WINDOWS:
            chosen = np.linspace(0, len(task.windows) - 1, WINDOWS).round().astype(int)
            task, own, free = replace(task, windows=task.windows.pick(chosen)), own[chosen], free[chosen]
        weight = 1.0 if state.fit is None else state.fit.weight
        hessian, slope, cost = normal_equations(model, task, names)
        return cls(begin, hessian, slope, cost, weight, own, free, judge.folds.numbers)

    def fit(self, names: Sequence[str], index: Index, priors: Priors) -> FreeRunFit:
        """Return a fit at this point in which some columns are free.

        Args:
            names: effects that these columns belong to.
            index: the free columns, (K,).
            priors: of the K free parameters.
        """
        return FreeRunFit(
            tuple(names),
            self.begin[index],
            priors,
            self.hessian[:, index[:, None], index],
            self.slope[:, index],
            self.cost,
            self.weight,
            True,
        )

    def left_out(self, fit: FreeRunFit, low: Array, high: Array) -> float:
        """Return the squared error of all folds, each predicted by the others.

        Args:
            fit: what is free, from `fit`.
            low: lower bounds of the free parameters, (K,).
            high: upper bounds, (K,).
        """
        total = 0.0
        for k, fold in enumerate(self.folds):
            mine, keep = self.own == fold, self.free[:, k]
            if mine.any():
                # Within the bounds, as the fit itself will be: what is promised beyond them cannot be had.
                theta = fit.step(keep, low, high) if keep.any() else fit.theta
                total += max(fit.predicted_error(theta, mine), 0.0)
        return total
