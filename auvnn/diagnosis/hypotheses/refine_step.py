"""Steps so short that what an integrator gets wrong is lost in the noise.

Without noise, or with little of it, the error of a step of the size of a sample is a trace of its own: it follows the
commands as a lag of the thrusters does, and is given that name.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.window_simulation import window_error
from auvnn.metrics.free_run import predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

# Each halving divides the error of Runge and Kutta's method by sixteen.
HALVINGS = 3


def refine_step(model: GreyBox, windows: Windows, initial: Tensor, sigma: NDArray[np.float64]) -> Windows:
    """Return windows with steps whose halving moves all predictions together by less than a standard error.

    An effect that imitates what the integrator gets wrong has at most that many standard errors.

    Args:
        model: at a fit.
        windows: B windows.
        initial: their initial states (B, 13).
        sigma: noise of each channel (18,).

    Returns:
        the same windows where their steps are short enough already.
    """
    steps = windows.times.diff(dim=-1)
    taken = windows
    at = min(windows.max_step, float(steps.max()))
    error = _error(model, windows, initial)
    seen = np.isfinite(sigma)
    for _ in range(HALVINGS):
        at /= 2
        halved = replace(windows, max_step=at)
        after = _error(model, halved, initial)
        apart = (((after - error) * windows.mask).numpy()[..., seen] / sigma[seen]) ** 2
        if not apart.sum() > 1.0:
            break
        taken, error = halved, after
    return taken


def _error(model: GreyBox, windows: Windows, initial: Tensor) -> Tensor:
    """Return measured minus predicted outputs, (B, L, 18)."""
    with torch.no_grad():
        there = model.without_absent()
        return window_error(there, windows, *predict(there, windows, initial, engine="firm"))
