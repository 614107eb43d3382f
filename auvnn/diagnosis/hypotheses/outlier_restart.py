"""A fit in which a few windows diverged is begun again from the estimate of the others.

Where a vehicle is unstable and its coefficients are off, a window of free running may leave the measured motion so far
that no small step of its initial state brings it back. Its error then drowns that of all the others: weights follow
errors, and no test finds anything. The others hold the coefficients well enough to bring it back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.prediction_error import FitError, Fitted, fit
from auvnn.estimation.priors import Priors
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

# A window is an outlier whose error is so many times the median's, and fit to lead the others back below so many.
DIVERGED, NEAR = 3.0, 2.0
# A fit that goes out from another one is left alone unless a window is as far out as this.
WILD = 1e3
# How often at most a fit is begun again, and steps of a window's initial state on its own.
TRIES, ALONE = 3, 30
# Steps after which a fit that was begun again must have smaller errors.
LOOK = 4
# Mean fall of the logarithm of the errors, or share of the squared error by fixed weights, below which another start has
# brought no window back.
WORTH = 0.01
# Each is fitted on its own where they are no larger a share of all.
FEW = 0.15


def fit_with_outlier_restart(
    model: GreyBox,
    windows: Windows,
    names: Sequence[str],
    priors: Priors,
    *,
    iterations: int,
    initial: Tensor | None = None,
    sigma: NDArray[np.float64] | None = None,
) -> Fitted:
    """Fit; where windows end as outliers, again from a fit without them.

    A fit that goes out from another one, by initial states or weights, is begun again only where no step leads on, or a
    window is so far out that it outweighs all others: the other fit had no outlier.

    Args:
        model: holds the named effects; it is not changed.
        windows: what to fit.
        names: effects whose parameters are free.
        priors: of those parameters.
        iterations: at most this many steps of each fit.
        initial: (B, 13) initial states to start from; the measured ones by default.
        sigma: (18,) fixed weights, by default estimated.

    Returns:
        the fit to all windows that leaves the smaller errors.

    Raises:
        FitError: there is nowhere to begin, whatever windows are left out.
    """
    plain = initial is None and sigma is None
    best = fit(model, windows, names, priors, initial=initial, sigma=sigma, iterations=iterations)
    for _ in range(TRIES):
        cost = best.statistics.cost
        middle = max(float(np.median(cost)), 1e-300)
        near = cost <= NEAR * middle
        settled = (cost <= (DIVERGED if plain or best.stuck else WILD) * middle).all()
        if near.all() or (settled and (best.converged or not plain)):
            break
        try:
            again = _begun_again(best, model, windows, names, priors, near, sigma, iterations)
        except FitError:
            break
        if not gain(best, again, sigma) > 0.0:
            break
        pays, best = _pays(best, again, sigma), again
        if not pays:
            # A model that is wrong has windows of large errors wherever it begins.
            break
    return best


def _begun_again(
    best: Fitted,
    model: GreyBox,
    windows: Windows,
    names: Sequence[str],
    priors: Priors,
    near: NDArray[np.bool_],
    sigma: NDArray[np.float64] | None,
    iterations: int,
) -> Fitted:
    """Return the fit to all windows from one to those that are near, each of the others brought back."""
    others = fit(
        best.model,
        windows.pick(near),
        names,
        priors,
        initial=best.initial[torch.as_tensor(near)],
        sigma=sigma,
        iterations=iterations,
    )
    initial = initial_states(model, windows)
    initial[torch.as_tensor(near)] = others.initial
    outliers = np.nonzero(~near)[0]
    # One that needs short steps would hold up the others.
    for few in np.array_split(outliers, len(outliers) if len(outliers) <= FEW * len(windows) else 1):
        initial[torch.as_tensor(few)] = _restarted(others, windows.pick(few))
    # Windows that were brought back show it at once; where none was, the steps to come lead where the fit has been.
    steps = min(LOOK, iterations)
    again = fit(others.model, windows, names, priors, initial=initial, sigma=sigma, iterations=steps)
    if again.converged or steps == iterations or not _pays(best, again, sigma):
        return again
    return fit(
        again.model, windows, names, priors, initial=again.initial, sigma=sigma, iterations=iterations - steps
    )


def gain(best: Fitted, again: Fitted, sigma: NDArray[np.float64] | None) -> float:
    """Return by how much another fit to the same windows leaves less.

    Args:
        best: the fit.
        again: the other one.
        sigma: (18,) fixed weights of both, and squared errors are compared; None where the weights follow the errors of
            each: then the negative log-likelihoods are.
    """
    return _errors(best) - _errors(again) if sigma is None else best.cost - again.cost


def _pays(best: Fitted, again: Fitted, sigma: NDArray[np.float64] | None) -> bool:
    """Whether another fit has brought windows back: its errors are smaller by more than a little."""
    return gain(best, again, sigma) >= (
        WORTH * best.statistics.count.sum() if sigma is None else WORTH * best.cost
    )


def _restarted(others: Fitted, outliers: Windows) -> Tensor:
    """Return the initial states of windows that fit them best under what the others say, (B, 13)."""
    nothing = Priors(np.zeros(0), np.zeros(0))
    return fit(others.model, outliers, (), nothing, sigma=others.sigma, iterations=ALONE).initial


def _errors(fitted: Fitted) -> float:
    """Return what a fit leaves in all channels: the negative log-likelihood at its own weights, up to a constant."""
    count, known = fitted.statistics.count.sum(0), np.isfinite(fitted.sigma)
    return float(count[known] @ np.log(fitted.sigma[known]))
