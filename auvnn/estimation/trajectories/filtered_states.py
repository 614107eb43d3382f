"""The trajectories of windows as they are known from the past at every moment: filtered states.

Where a stochastic force moves the vehicle, the motion itself tells of the force. Slopes that are taken at states which
later measurements have told of go together with the errors that the force makes, and steps by them lead to wrong values
of whatever damps the motion, or turns with it. Slopes at states that are known from the past alone do not: what a
measurement adds to that, its innovation, goes together with nothing that was known before.

The states' changes about given trajectories, with the force as a Markov process, are filtered by Kalman's equations. In
each window the filter begins with a state of which little is known.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237; Ljung (1999), System Identification,
section 4.3, for predictors that use the past alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.force_marginalisation.columns import PUSH, pushed
from auvnn.estimation.force_marginalisation.sums import LOOSE
from auvnn.estimation.point_slopes import OperatingPoint, differentiate
from auvnn.estimation.propagation import interval_maps
from auvnn.estimation.sensitivity import middles, reports, split_slopes
from auvnn.estimation.window_simulation import simulate_windows
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]


def filtered_states(model: GreyBox, windows: Windows, sigma: Array) -> Tensor:
    """Return the trajectories that are known from the past, (B, L, 13): position, quaternion, velocity.

    Args:
        model: at the values in question.
        windows: B windows, with trajectories about which they are linear and with the law of a force.
        sigma: (18,) the sensors' white noise, infinite where a channel does not count.
    """
    law, around = windows.law, windows.around
    assert law is not None and around is not None
    # Sensors are filtered as if their noise were white.
    plain = replace(windows, noise=None)
    forward, forced, defect, seen, error = _maps(model, plain)
    axes = law.axes
    forced = forced[..., axes]
    rms, time = torch.as_tensor(law.rms[axes]), torch.as_tensor(law.time[axes])
    known = np.flatnonzero(np.isfinite(sigma[:12]))
    noise = torch.as_tensor(sigma[known] ** 2)
    seen, error, mask = seen[:, :, known], error[..., known], windows.mask[..., known]
    times = windows.times[:, windows.warmup :]
    keep = torch.exp(-(times[:, 1:] - times[:, :-1])[..., None] / time)
    count, size = len(around), 12 + len(axes)
    mean = error.new_zeros(count, size, 1)
    spread = torch.diag(torch.cat([torch.as_tensor(LOOSE**2.0), rms**2])).expand(count, -1, -1)
    # What was measured counts by its noise, and what was not by none at all.
    weight = mask / noise
    whole = error.new_zeros(count, size, size)
    whole[:, 12:, 12:] = torch.eye(len(axes), dtype=error.dtype)
    eye = torch.eye(size, dtype=error.dtype)
    away = []
    for k in range(error.shape[1]):
        rows = torch.nn.functional.pad(seen[:, k], (0, len(axes)))
        heavy = rows.mT * weight[:, k, None]
        news = heavy @ (error[:, k, :, None] - rows @ mean)
        # P - P H^T (H P H^T + R)^-1 H P = (1 + P H^T R^-1 H)^-1 P, which takes any sensor that is missing.
        gain = torch.linalg.solve(eye + spread @ (heavy @ rows), spread)
        mean = mean + gain @ news
        spread = 0.5 * (gain + gain.mT)
        away.append(mean[:, :12, 0])
        if k < forward.shape[1]:
            step = whole.clone()
            step[:, :12, :12], step[:, :12, 12:] = forward[:, k], forced[:, k]
            step[:, 12:, 12:] = torch.diag_embed(keep[:, k])
            mean = step @ mean
            mean[:, :12, 0] += defect[:, k]
            spread = step @ spread @ step.mT
            spread[:, 12:, 12:] += torch.diag_embed(rms**2 * (1.0 - keep[:, k] ** 2))
    found = torch.stack(away, dim=1)
    return moved(around.flatten(0, 1), found.flatten(0, 1)).unflatten(0, around.shape[:2])


def _maps(
    model: GreyBox, windows: Windows, chunk: int = 2048
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Return how the states of windows that are linear about given trajectories go on, and how they are seen.

    Args:
        model: at the values in question.
        windows: B windows of L samples, with trajectories and with a force's law.
        chunk: points differentiated at a time.

    Returns:
        what each interval makes of the state's change, (B, L - 1, 12, 12), and of a unit wrench, (B, L - 1, 12, 6);
        the defects (B, L - 1, 12); what is reported of the state's change, (B, L, 12, 12), and the errors (B, L, 12).
    """
    whole = pushed(model.without_absent(), [])[0]
    order = whole.effect_names.index(PUSH)
    thetas = {f"model.effects.{order}.theta": whole.members[order].theta.detach()}
    with torch.no_grad():
        ran = simulate_windows(model.without_absent(), windows, windows.nu[:, 0], [])
    times, inputs = windows.times[:, windows.warmup :], windows.inputs.rows(windows.warmup)
    points = middles(ran, times, inputs)
    rate = differentiate(OperatingPoint(whole), "rate", points, thetas, chunk)
    jac_state, _, push = (x.unflatten(0, ran.nu[:, 1:].shape[:2]) for x in split_slopes(rate, ran))
    if windows.law is not None and windows.law.response is not None:
        push = torch.as_tensor(windows.law.response).expand(push.shape)
    forward, forced = interval_maps(jac_state, push, points[1], points[2], times[:, 1:] - times[:, :-1])
    seen = reports(whole, windows, ran, times, inputs, thetas, chunk).state
    here = torch.eye(12, dtype=forward.dtype).expand(*ran.nu.shape[:2], 12, 12)
    assert ran.defect is not None
    return forward, forced, ran.defect, here if seen is None else seen[:, :, :12], ran.error[..., :12]
