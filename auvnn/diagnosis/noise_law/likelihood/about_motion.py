"""Explanations under a law, linear about the motion: windows are linearised about the trajectories that are likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.likelihood.estimate_law import Estimate
from auvnn.estimation.trajectories.filtered_states import filtered_states
from auvnn.estimation.trajectories.smoothed_states import smoothed_states
from auvnn.metrics.free_run import away
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Standard deviations of the sensors' noise, root mean square of a channel, within which trajectories are the same.
SAME = 1.0


def linear_about_its_own(
    explanation: FittedHypothesis, windows: Windows, estimate: Estimate, sigma: Array
) -> FittedHypothesis | None:
    """Return an explanation that is linear about its own likeliest trajectories; None where it already is.

    Args:
        explanation: fitted, linear about free running or about some trajectories.
        windows: B windows, without a law.
        estimate: of the law, and of where the parameters go with it.
        sigma: (18,) the sensors' white noise.
    """
    fitted = explanation.fitted
    asked = replace(windows, law=estimate.law, around=explanation.around)
    smoothed = smoothed_states(fitted.model, asked, fitted.initial, explanation.names, sigma, estimate.step)
    found = filtered_states(fitted.model, replace(asked, around=smoothed), sigma)
    if not bool(torch.isfinite(found).all()):
        return None
    if explanation.around is not None and _same(found, explanation.around, windows.mask, sigma):
        return None
    return replace(explanation, around=found)


def _same(one: Tensor, other: Tensor, mask: Tensor, sigma: Array) -> bool:
    """Whether trajectories (B, L, 13) differ by less than the sensors' noise where they were measured."""
    seen = mask[..., :12]
    square = (away(other, one) ** 2 * seen).sum((0, 1)) / seen.sum((0, 1)).clamp(min=1.0)
    size = np.sqrt(square.numpy())
    known = np.isfinite(sigma[:12])
    return bool((size[known] < SAME * sigma[:12][known]).all())
