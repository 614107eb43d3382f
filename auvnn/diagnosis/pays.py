"""Whether an effect pays: free running on what was left out must improve by more than its own uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.explain import Explanation, by_stretches

Array = NDArray[np.float64]
# Share of the information on an effect from which a run is the only one that counts.
ONE_RUN = 0.6


def pays(after: Explanation, before: Explanation) -> bool:
    """Whether the error on what was left out falls by more than its own uncertainty.

    Runs are left out. What shows in one run alone cannot be foreseen from the others: where most of what the log says
    of the newest effect is in one run, stretches of all runs may be left out instead.
    """
    if _falls(after.left_out, before.left_out):
        return True
    return in_one_run(after) and _falls(by_stretches(after), by_stretches(before))


def _falls(after: Array, before: Array) -> bool:
    gain = before - after
    return float(gain.sum()) > float(np.sqrt(len(gain)) * gain.std(ddof=1))


def in_one_run(explanation: Explanation) -> bool:
    """Whether one run of several holds most of the information on the newest effect."""
    fitted, newest = explanation.fitted, explanation.effects[-1]
    sizes = [fitted.model.effect(n).theta.numel() for n in explanation.names]
    begin = sum(sizes[: explanation.names.index(newest)])
    described = fitted.model.effect(newest).parameters_of
    scale = np.array([p.scale for p in described])
    own = np.diagonal(fitted.statistics.hessian, axis1=1, axis2=2)[:, begin : begin + len(scale)] @ scale**2
    by_run = np.array([own[fitted.statistics.run == run].sum() for run in np.unique(fitted.statistics.run)])
    return len(by_run) > 1 and bool(by_run.max() > ONE_RUN * by_run.sum())
