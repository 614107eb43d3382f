"""Steps of windows' initial states, taken window by window where one step for all would lead away.

Free running of an unstable vehicle is far from linear in its initial state: the step of Gauss and Newton that suits most
windows may throw a few of them further off. Each window's initial state is its own, so each may go its own share of the
way; only the parameters are common to all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.window_normal_equations import weights_of
from auvnn.estimation.window_simulation import runs_by_block
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Shares of its step that a window tries where the whole one raises its error; nothing where more windows than this
# share of all are raised: then it is the parameters' step that is too long.
SHARES, MOST = (0.3, 0.1, 0.0), 0.5


def window_costs(errors: Sequence[Tensor], sigma: Array) -> Tensor:
    """Return each window's weighted squared error, (B,); infinite where it left what is finite.

    Args:
        errors: by blocks of windows, each (b, L, 18).
        sigma: weights of the errors, (18,).
    """
    weight = weights_of(sigma)
    cost = torch.cat([((error * weight) ** 2).flatten(1).sum(1) for error in errors])
    return torch.where(torch.isfinite(cost), cost, torch.inf)


def better_of(
    model: GreyBox, windows: Windows, names: Sequence[str], sigma: Array, before: Tensor, old: Tensor, new: Tensor
) -> Tensor:  # fmt: skip
    """Return of each window's initial states, (B, 13), the new one where its error is not larger than at the old one.

    Args:
        model: at the fitted values.
        windows: B windows.
        names: effects whose parameters were fitted.
        sigma: weights of the errors, (18,).
        before: each window's error at the old ones, (B,).
        old: initial states, (B, 13).
        new: where a step leads, (B, 13).
    """
    if not bool(torch.isfinite(new).all()):
        return old
    return torch.where((costs_from(model, windows, names, sigma, new) <= before)[:, None], new, old)


def shorter_steps(
    model: GreyBox, windows: Windows, names: Sequence[str], sigma: Array, before: Tensor, initial: Tensor,
    follows: Array, own: Array,
) -> Tensor | None:  # fmt: skip
    """Return initial states (B, 13) after steps of which some windows take a share; None where that is no remedy.

    Args:
        model: at the values that are tried.
        windows: B windows.
        names: effects whose parameters are fitted.
        sigma: weights of the errors, (18,).
        before: each window's error before the step, (B,).
        initial: states before it, (B, 13).
        follows: how the initial states follow the parameters' step, (B, 12), see `moved`.
        own: what each gains for itself, (B, 12), of which a window may take a share.
    """
    trial = moved(initial, torch.as_tensor(follows + own))
    if not bool(torch.isfinite(trial).all()):
        return None
    lowest = costs_from(model, windows, names, sigma, trial)
    raised = lowest > before
    if not bool(raised.any()) or float(raised.double().mean()) > MOST:
        return None
    chosen = raised.numpy()
    some, follows, own = windows.pick(chosen), follows[chosen], own[chosen]
    best, least = trial[raised], lowest[raised]
    for share in SHARES:
        at = moved(initial[raised], torch.as_tensor(follows + share * own))
        cost = costs_from(model, some, names, sigma, at)
        best = torch.where((cost < least)[:, None], at, best)
        least = torch.minimum(cost, least)
    out = trial.clone()
    out[raised] = best
    return out


def costs_from(
    model: GreyBox, windows: Windows, names: Sequence[str], sigma: Array, initial: Tensor
) -> Tensor:
    """Return each window's weighted squared error of a free run, (B,); infinite where it left what is finite.

    Args:
        model: that runs.
        windows: B windows.
        names: effects whose parameters are fitted.
        sigma: weights of the errors, (18,).
        initial: where the runs begin, (B, 13).
    """
    return window_costs([error for _, _, error in runs_by_block(model, windows, initial, names)], sigma)
