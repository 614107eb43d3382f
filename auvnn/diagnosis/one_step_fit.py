"""Explanations fitted to accelerations one step ahead instead of free-running windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.explain import FOLDS, Explanation, left_out
from auvnn.diagnosis.nuisance import Layout, priors
from auvnn.logs import Log
from auvnn.metrics.one_step import Derivative
from auvnn.training.one_step_error import fit_one_step
from auvnn.training.prediction_error import Fitted, set_parameters

Array = NDArray[np.float64]
# Neighbouring stretches are correlated; so many groups of them stand for independent ones.
GROUPS = 20


def explain_one_step(
    layout: Layout,
    log: Log,
    base: Sequence[str],
    effects: Sequence[str],
    how: Derivative,
    *,
    start: Fitted | None = None,
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """Fit effects jointly with the base by one-step errors, and judge them on runs left out.

    Args:
        layout: stated values and columns.
        log: what to fit on.
        base: effects that are free anyway.
        effects: effects asked for; a stated uncertainty among them is set free.
        how: how accelerations are obtained.
        start: a fit from which to go out and whose weights to keep, so that errors can be compared.
        progress: told in words after each step.
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
    run = fitted.statistics.run
    runs = np.unique(run)
    fold = np.searchsorted(runs, run) if len(runs) >= 2 else np.arange(len(run)) * FOLDS // len(run)
    cost = left_out(fitted.statistics, fitted.theta, held, fold)
    count = fitted.statistics.count[:, np.isfinite(fitted.sigma)].sum(1)
    return Explanation(tuple(effects), fitted, names, 0.0, cost, count)


def left_out_gain(before: Explanation, after: Explanation) -> dict[str, float]:
    """Return the weighted error on runs left out before and after, and the fall with its standard error.

    Both fits must have the same weights and stretches; the error is one where the fit before is as good on
    runs left out as on those fitted. The standard error is by leaving out groups of stretches (Kuensch 1989).
    """
    total = float(before.left_out_count.sum())
    group = (
        np.arange(len(before.left_out)) * min(GROUPS, len(before.left_out)) // max(len(before.left_out), 1)
    )

    def fall(keep: NDArray[np.bool_]) -> float:
        size = max(float(before.left_out_count[keep].sum()), 1.0)
        first, last = (max(float(e.left_out[keep].sum()), 0.0) for e in (before, after))
        return float(np.sqrt(first / size) - np.sqrt(last / size))

    without = np.array([fall(group != g) for g in np.unique(group)])
    n = len(without)
    std = float(np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum())) if n > 1 and total else np.inf
    return {"before": before.cv, "after": after.cv, "gain": before.cv - after.cv, "std": std}
