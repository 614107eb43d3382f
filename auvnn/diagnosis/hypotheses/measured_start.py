"""A fit that goes out from a wrong model's initial states is begun from the measured ones, too, where most error is left.

Over several seconds the motion of a vehicle that is barely stable depends so strongly on where it begins that the squared
error has many local minima. Of a model that is wrong, the initial states that fit best may be far from those that were
measured; a fit of the right effect that goes out from them stays there. Where a REMUS has a tenth of the Coriolis force
of its added mass, the right effect left four times the squared error that it leaves from the measured states.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.outlier_restart import fit_with_outlier_restart, gain
from auvnn.estimation.prediction_error import FitError, Fitted
from auvnn.estimation.priors import Priors
from auvnn.estimation.trajectories.initial_steps import costs_from
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

# Where the noise is less than this share of the squared error that is left, most of the error is left.
GROSS = 0.5
# The fit is begun from the measured states where these predict such a share of the windows better, or where the fitted
# velocities of most windows are farther from the measured ones than so many standard deviations of the sensor.
BETTER, FAR = 0.05, 30.0
VELOCITY, SENSED = slice(7, 13), slice(6, 12)


def noise_share(found: Fitted) -> float:
    """Return the share of the sensors' white noise in the squared error that is left, mean of the channels.

    Args:
        found: a fit.
    """
    seen = np.isfinite(found.sigma)
    sums = found.statistics
    left = sums.channel.sum(0)[seen]
    noise = sums.count.sum(0)[seen] * sums.noise()[seen] ** 2
    return float(np.mean(np.minimum(noise / np.maximum(left, 1e-300), 1.0)))


def above_noise(found: Fitted) -> float:
    """Return what is left of the squared error above the sensors' white noise, as a share of that.

    Args:
        found: a fit.
    """
    return 1.0 / max(noise_share(found), 1e-12) - 1.0


def better_from_measured(
    best: Fitted,
    model: GreyBox,
    windows: Windows,
    names: Sequence[str],
    priors: Priors,
    *,
    initial: Tensor,
    sigma: NDArray[np.float64] | None,
    iterations: int,
) -> Fitted:
    """Return the better of a fit and of the same one from the measured initial states, where these may serve.

    Args:
        best: the fit.
        model: where it went out from.
        windows: what was fitted.
        names: effects whose parameters are free.
        priors: of those parameters.
        initial: the initial states that it went out from, (B, 13).
        sigma: (18,) fixed weights; None where they follow the errors.
        iterations: at most this many steps of the fit.
    """
    if windows.law is not None or noise_share(best) >= GROSS:
        return best
    measured, running = initial_states(model, windows), model.without_absent(names)
    if not _far(best, measured):
        here, there = (costs_from(running, windows, names, best.sigma, i) for i in (initial, measured))
        if float((there < here).double().mean()) < BETTER:
            return best
    try:
        again = fit_with_outlier_restart(
            model, windows, names, priors, initial=measured, sigma=sigma, iterations=iterations
        )
    except FitError:
        return best
    return again if gain(best, again, sigma) > 0.0 else best


def _far(best: Fitted, measured: Tensor) -> bool:
    """Whether the fit begins most windows at velocities that no sensor would have taken for the measured ones."""
    noise = np.maximum(best.statistics.noise()[SENSED], 1e-9)
    away = np.median(np.abs((best.initial - measured).numpy()[:, VELOCITY]), axis=0) / noise
    return bool((away[np.isfinite(best.sigma[SENSED])] > FAR).any())
