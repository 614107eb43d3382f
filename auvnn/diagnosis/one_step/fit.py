"""Explanations fitted to accelerations one step ahead instead of free-running windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FOLDS, FittedHypothesis, left_out
from auvnn.diagnosis.hypotheses.stated_priors import Layout, priors
from auvnn.estimation.one_step_error import fit_one_step
from auvnn.estimation.prediction_error import Fitted
from auvnn.estimation.priors import set_parameters
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative

Array = NDArray[np.float64]
# Neighbouring stretches are correlated; so many groups of them stand for independent ones.
GROUPS = 20


def fit_hypothesis_one_step(
    layout: Layout,
    log: Log,
    base: Sequence[str],
    effects: Sequence[str],
    how: Derivative,
    *,
    start: Fitted | None = None,
    progress: Callable[[str], None] | None = None,
) -> FittedHypothesis:
    """Fit effects jointly with the base by one-step errors, and judge them on runs left out.

    Args:
        layout: stated values and columns.
        log: what to fit on.
        base: effects that are free anyway.
        effects: effects asked for; a stated uncertainty among them is set free.
        how: how accelerations are obtained.
        start: a fit from which to go out and whose weights to keep, so that errors can be compared.
        progress: called with the state of the work, in words, after each step.
    """
    names = tuple(dict.fromkeys([*base, *effects]))
    held = priors(layout, names, free=effects)
    model = layout.model.rebuilt(layout.model.copied_effects())
    for name in names:
        effect = model.effect(name)
        if start is None or name not in start.names:
            # At the null itself an effect may have no slope; its own probe is where to begin.
            values = [p.probes[0] if p.probes and v == p.null else v for p, v in
                      zip(effect.parameters_of, effect.values().values(), strict=True)]  # fmt: skip
            set_parameters(model, [name], np.array(values))
    if start is not None:
        set_parameters(model, start.names, start.theta)
    sigma = None if start is None else start.sigma
    fitted = fit_one_step(model, log, names, held, how, sigma=sigma, progress=progress)
    cost = left_out(fitted.statistics, fitted.theta, held, _folds(fitted, "run"))
    count = fitted.statistics.count[:, np.isfinite(fitted.sigma)].sum(1)
    return FittedHypothesis(tuple(effects), fitted, names, 0.0, cost, count)


def _folds(fitted: Fitted, by: str) -> NDArray[np.int64]:
    """Return each stretch's fold, (B,): its run where there are several, or its fifth of the run."""
    run = fitted.statistics.run
    runs, index = np.unique(run, return_inverse=True)
    if by == "run" and len(runs) > 1:
        return index
    fold = np.empty(len(run), dtype=np.int64)
    for k in range(len(runs)):
        own = np.flatnonzero(index == k)
        fold[own] = np.arange(len(own)) * FOLDS // len(own)
    return fold


def left_out_gain(before: FittedHypothesis, after: FittedHypothesis, by: str = "run") -> dict[str, float]:
    """Return the weighted error on what is left out before and after, and the fall with its standard error.

    Both fits must have the same weights and stretches; the error is one where the fit before is as good on what is
    left out as on what is fitted. The standard error is by leaving out groups of stretches (Kuensch 1989).

    Args:
        before: fit without.
        after: fit with.
        by: "run", or "fifth" of every run: where only one run drives a degree of freedom, nothing is known of that
            once the run is left out, and only its fifths can tell.
    """
    first, last = (
        left_out(e.fitted.statistics, e.fitted.theta, e.fitted.priors, _folds(e.fitted, by))
        for e in (before, after)
    )
    count, size = before.left_out_count, len(first)
    group = np.arange(size) * min(GROUPS, size) // max(size, 1)

    def errors(keep: NDArray[np.bool_]) -> Array:
        samples = max(float(count[keep].sum()), 1.0)
        return np.sqrt(np.maximum([first[keep].sum(), last[keep].sum()], 0.0) / samples)

    whole = errors(group >= 0)
    without = np.array([-np.diff(errors(group != g))[0] for g in np.unique(group)])
    n = len(without)
    std = float(np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum())) if n > 1 else float("inf")
    return {
        "before": float(whole[0]),
        "after": float(whole[1]),
        "gain": float(whole[0] - whole[1]),
        "std": std,
    }
