"""The trajectories that windows most likely took, given all their measurements: smoothed states.

With a stochastic force, free running leaves the motion the farther the longer it lasts, and what is linear about it says
little of the motion. The trajectory that a window most likely took is found from its errors: initial state and force that
explain them best, and the states to which these lead. Linearised again about these states, the errors are linear near the
motion itself, whatever the force; after a few turns this is the iterated smoother, a method of Gauss and Newton for the
likeliest trajectory.

Reference: Bell (1994), SIAM Journal on Optimization 4(3) 626-636, the iterated Kalman smoother as a Gauss-Newton method.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.force_marginalisation.sums import sums_with_force
from auvnn.estimation.window_normal_equations import linearise, weights_of
from auvnn.metrics.free_run import moved, predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]


def smoothed_states(
    model: GreyBox, windows: Windows, initial: Tensor, names: Sequence[str], sigma: Array, step: Array
) -> Tensor:
    """Return the likeliest trajectories, (B, L, 13): position, quaternion, velocity.

    Args:
        model: at the values about which the windows are linear.
        windows: B windows with the law of a force; linear about their trajectories, or else about free running.
        initial: initial states of the free running, (B, 13).
        names: effects whose parameters move.
        sigma: (18,) the sensors' white noise, infinite where a channel does not count.
        step: by how much the parameters move, (P,).
    """
    weight = weights_of(sigma)
    change = torch.as_tensor(step)
    parts = []
    for answer in linearise(model, windows, initial, names, motion=slice(None)):
        assert answer.motion is not None and answer.force is not None
        live = [k for k in torch.nonzero(weight).flatten().tolist() if k < answer.parameters.shape[2]]
        _, solved, _ = sums_with_force(answer, weight, live, leverage=False)
        hidden = solved[..., 0] - solved[..., 1:] @ change
        own = change.expand(len(hidden), -1)
        along = [hidden[:, :12], own, hidden[:, 12:]]
        if windows.around is not None:
            along.append(hidden.new_ones(len(hidden), 1))
        parts.append((answer.motion @ torch.cat(along, dim=-1)[:, None, :, None]).squeeze(-1))
    away = torch.cat(parts)
    begun = windows.around
    if begun is None:
        with torch.no_grad():
            begun = torch.cat(predict(model.without_absent(), windows, initial, engine="firm"), dim=-1)
    return moved(begun.flatten(0, 1), away.flatten(0, 1)).unflatten(0, begun.shape[:2])
