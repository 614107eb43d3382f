"""A fit in which a few windows went astray is begun again from what the others say.

Where a vehicle is unstable and its coefficients are off, a window of free running may leave the measured motion so far
that no small step of its initial state brings it back. Its error then drowns that of all the others: weights follow
errors, and no test finds anything. The others hold the coefficients well enough to bring it back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from auvnn.estimation.prediction_error import Fitted, fit
from auvnn.estimation.priors import Priors
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

# A window is astray whose error is so many times the median's, and fit to lead the others back below so many.
ASTRAY, NEAR = 3.0, 2.0
# How often at most a fit is begun again, and steps of a window's initial state on its own.
TRIES, ALONE = 3, 30
# Each is fitted on its own where they are no larger a share of all.
FEW = 0.15


def fit_with_outlier_restart(
    model: GreyBox, windows: Windows, names: Sequence[str], priors: Priors, *, iterations: int
) -> Fitted:
    """Fit from the measured initial states; where windows end astray, again from a fit without them.

    Args:
        model: holds the named effects; it is not changed.
        windows: what to fit.
        names: effects whose parameters are free.
        priors: of those parameters.
        iterations: at most this many steps of each fit.

    Returns:
        the fit to all windows that leaves the smaller errors.
    """
    best = fit(model, windows, names, priors, iterations=iterations)
    for _ in range(TRIES):
        cost = best.statistics.cost
        near = cost <= NEAR * np.median(cost)
        if near.all() or (best.converged and (cost <= ASTRAY * np.median(cost)).all()):
            break
        others = fit(best.model, windows.pick(near), names, priors, iterations=iterations)
        initial = initial_states(model, windows)
        initial[torch.as_tensor(near)] = others.initial
        strays = np.nonzero(~near)[0]
        # One that needs short steps would hold up the others.
        for few in np.array_split(strays, len(strays) if len(strays) <= FEW * len(windows) else 1):
            initial[torch.as_tensor(few)] = _restarted(others, windows.pick(few))
        again = fit(others.model, windows, names, priors, initial=initial, iterations=iterations)
        if _errors(again) >= _errors(best):
            break
        best = again
    return best


def _restarted(others: Fitted, strays: Windows) -> Tensor:
    """Return the initial states of windows that fit them best under what the others say, (B, 13)."""
    nothing = Priors(np.zeros(0), np.zeros(0))
    return fit(others.model, strays, (), nothing, sigma=others.sigma, iterations=ALONE).initial


def _errors(fitted: Fitted) -> float:
    """Return what a fit leaves in all channels: the negative log-likelihood at its own weights, up to a constant."""
    count, known = fitted.statistics.count.sum(0), np.isfinite(fitted.sigma)
    return float(count[known] @ np.log(fitted.sigma[known]))
