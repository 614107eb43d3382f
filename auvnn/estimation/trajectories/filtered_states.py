"""The trajectories of windows as they are known from the past at every moment: filtered states.

Where a stochastic force moves the vehicle, the motion itself tells of the force. Slopes that are taken at states which
later measurements have told of go together with the errors that the force makes, and steps by them lead to wrong values
of whatever damps the motion, or turns with it. Slopes at states that are known from the past alone do not: what a
measurement adds to that, its innovation, goes together with nothing that was known before.

The states' changes about given trajectories, with the force as a Markov process, are filtered by Kalman's equations. A
window that begins with the sample with which another one ends begins with what that one knew; of other windows' first
states little is known, and what is filtered there is as noisy as the sensors are. Noise that is not white counts as white
noise with the same spectrum at low frequencies.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237; Ljung (1999), System Identification,
section 4.3, for predictors that use the past alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.force_marginalisation.columns import PUSH, pushed
from auvnn.estimation.force_marginalisation.sums import LOOSE
from auvnn.estimation.point_slopes import OperatingPoint, differentiate
from auvnn.estimation.propagation import interval_maps
from auvnn.estimation.sensitivity import middles, reports, split_slopes
from auvnn.estimation.trajectories.windows_in_turn import followed, offsets
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
        sigma: (18,) the sensors' noise, infinite where a channel does not count.
    """
    law, around = windows.law, windows.around
    assert law is not None and around is not None
    forward, forced, defect, seen, error = _maps(model, replace(windows, noise=None))
    axes = law.axes
    forced = forced[..., axes]
    rms, time = torch.as_tensor(law.rms[axes]), torch.as_tensor(law.time[axes])
    known = np.flatnonzero(np.isfinite(sigma[:12]))
    # What was measured counts by its noise, and what was not by none at all.
    weight = windows.mask[..., known] / torch.as_tensor(_as_white(windows, sigma)[known] ** 2)
    times = windows.times[:, windows.warmup :]
    keep = torch.exp(-(times[:, 1:] - times[:, :-1])[..., None] / time)
    run = _Filter(forward, forced, defect, seen[:, :, known], error[..., known], keep, rms)
    loose = torch.diag(torch.cat([torch.as_tensor(LOOSE**2.0), rms**2])).expand(len(around), -1, -1)
    none = loose.new_zeros(*loose.shape[:2], 1)
    found, mean, spread = run(weight, none, loose)
    before, _ = followed(windows, 0.0, len(windows))
    offset, same = offsets(windows, around, before)
    if bool(same.any()):
        # What the window before knew at its end was known when this one begins; the sample that both share counts once.
        other = torch.as_tensor(np.maximum(before, 0))
        led = mean[other] + torch.nn.functional.pad(offset, (0, len(axes)))[..., None]
        here = same[:, None, None]
        weight = weight.clone()
        weight[same, 0] = 0.0
        found, _, _ = run(weight, torch.where(here, led, none), torch.where(here, spread[other], loose))
    return moved(around.flatten(0, 1), found.flatten(0, 1)).unflatten(0, around.shape[:2])


def _as_white(windows: Windows, sigma: Array) -> Array:
    """Return standard deviations of white noise that says as much of a slow motion as the sensors' noise, (18,).

    Of noise whose neighbours have the correlation r, the spectrum at low frequencies is (1 + r) / (1 - r) times that of
    white noise of the same variance.

    Args:
        windows: with the colour of the noise.
        sigma: (18,) the sensors' noise.
    """
    if windows.noise is None:
        return sigma
    rho, _ = windows.noise.correlation(windows.mask, windows.times[:, windows.warmup :])
    mean = (rho.sum((0, 1)) / (rho > 0.0).sum((0, 1)).clamp(min=1)).numpy()
    return sigma * np.sqrt((1.0 + mean) / (1.0 - mean))


@dataclass(frozen=True)
class _Filter:
    """Kalman's filter over windows that are linear about given trajectories.

    Attributes:
        forward: what each interval makes of the state's change, (B, L - 1, 12, 12).
        forced: the same of forces, (B, L - 1, 12, A).
        defect: from the trajectory to where its intervals lead, (B, L - 1, 12).
        seen: what is reported of the state's change, (B, L, C, 12).
        error: the errors about the trajectory, (B, L, C).
        keep: what is left of each force at the end of an interval, (B, L - 1, A).
        rms: of the forces, (A,).
    """

    forward: Tensor
    forced: Tensor
    defect: Tensor
    seen: Tensor
    error: Tensor
    keep: Tensor
    rms: Tensor

    def __call__(self, weight: Tensor, mean: Tensor, spread: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the changes of the states that are known from the past, (B, L, 12), and what is known at the end.

        Args:
            weight: of the errors, (B, L, C).
            mean: of the first state's change and of the forces there, (B, 12 + A, 1).
            spread: its covariance.
        """
        count, size, _ = mean.shape
        forces = size - 12
        whole = mean.new_zeros(count, size, size)
        whole[:, 12:, 12:] = torch.eye(forces, dtype=mean.dtype)
        eye, found = torch.eye(size, dtype=mean.dtype), []
        for k in range(self.error.shape[1]):
            rows = torch.nn.functional.pad(self.seen[:, k], (0, forces))
            heavy = rows.mT * weight[:, k, None]
            news = heavy @ (self.error[:, k, :, None] - rows @ mean)
            # P - P H^T (H P H^T + R)^-1 H P = (1 + P H^T R^-1 H)^-1 P, which takes any sensor that is missing.
            gain = torch.linalg.solve(eye + spread @ (heavy @ rows), spread)
            mean = mean + gain @ news
            spread = 0.5 * (gain + gain.mT)
            found.append(mean[:, :12, 0])
            if k < self.forward.shape[1]:
                step = whole.clone()
                step[:, :12, :12], step[:, :12, 12:] = self.forward[:, k], self.forced[:, k]
                step[:, 12:, 12:] = torch.diag_embed(self.keep[:, k])
                mean = step @ mean
                mean[:, :12, 0] += self.defect[:, k]
                spread = step @ spread @ step.mT
                spread[:, 12:, 12:] += torch.diag_embed(self.rms**2 * (1.0 - self.keep[:, k] ** 2))
        return torch.stack(found, dim=1), mean, spread


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
