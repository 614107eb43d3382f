"""Initial states of windows estimated from what was measured in them, the parameters being what they are.

Each window's state at its first sample is free; what the sensors measured there is where the search begins. Fits that
estimate them together with parameters are in `prediction_error`, and eliminate them by `window_normal_equations`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, as_tensor

from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Steps of Gauss and Newton for each window's initial state: a few seconds of free running are nearly linear in it.
ROUNDS = 2


def fit_initial_states(
    model: GreyBox, windows: Windows, sigma: Array, initial: Tensor | None = None, rounds: int = ROUNDS
) -> Tensor:
    """Return the initial states (B, 13) that fit windows best, the parameters being what they are.

    Args:
        model: the model.
        windows: B windows.
        sigma: (18,), infinite where a channel does not count.
        initial: where to start; the measured states by default.
        rounds: steps.
    """
    initial = initial_states(model, windows) if initial is None else initial
    for _ in range(rounds):
        _, change, _ = normal_equations(windows, linearise(model, windows, initial, []), sigma)
        initial = moved(initial, as_tensor(change))
    return initial
