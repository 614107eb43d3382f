"""A fit that no step leads on is begun again from a fit to parts of its windows.

Over several seconds the motion of a vehicle that turns over, or is barely stable, depends so strongly on the parameters
that a few windows hold up every step of a fit, however right its direction is for all others: fins that are mounted 0.15
rad off were not found at all. Over a quarter of the time the same windows are nearly linear; from what they say the whole
ones can be fitted, which tell more of slow effects.

Reference: Bock and Plitt (1984), multiple shooting; Ribeiro et al. (2020), Automatica 121, for the length of the windows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.outlier_restart import fit_with_outlier_restart, gain
from auvnn.estimation.prediction_error import FitError, Fitted
from auvnn.estimation.priors import Priors
from auvnn.estimation.window_parts import split
from auvnn.metrics.windows import Windows

# Into how many parts windows are divided, until a fit to them is not stuck.
PARTS = (4, 8)


def better_from_parts(
    best: Fitted,
    windows: Windows,
    names: Sequence[str],
    priors: Priors,
    *,
    sigma: NDArray[np.float64] | None,
    iterations: int,
) -> Fitted:
    """Return the better of a fit that is stuck and of one that begins where parts of the windows lead.

    Args:
        best: the fit.
        windows: what was fitted.
        names: effects whose parameters are free.
        priors: of those parameters.
        sigma: (18,) fixed weights; None where they follow the errors.
        iterations: at most this many steps of each fit.
    """
    if not best.stuck or windows.law is not None:
        return best
    times = windows.times[:, windows.warmup :]
    longest = float((times[:, -1] - times[:, 0]).max())
    try:
        for count in PARTS:
            parts, whole, begins = split(windows, longest / count)
            if len(parts) == len(windows):
                return best
            found = fit_with_outlier_restart(best.model, parts, names, priors, iterations=iterations)
            if not found.stuck:
                break
        initial = best.initial.clone()
        first = torch.as_tensor(begins == 0)
        initial[torch.as_tensor(whole)[first]] = found.initial[first]
        again = fit_with_outlier_restart(
            found.model, windows, names, priors, initial=initial, sigma=sigma, iterations=iterations
        )
    except FitError:
        return best
    return again if gain(best, again, sigma) > 0.0 else best
