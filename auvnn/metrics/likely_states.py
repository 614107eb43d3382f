"""Where a free run starts where some of its state has no sensor: at the values that its window speaks for."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from auvnn.effects import Sensed
from auvnn.metrics.free_run import initial_states, moved, predict
from auvnn.metrics.windows import CHANNELS, Windows
from auvnn.models import GreyBox
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_rotvec

# What is not measured starts where it was estimated, give or take this: rad, m/s, rad/s.
WIDE = {
    **dict.fromkeys(("phi", "theta", "psi"), 0.3),
    **dict.fromkeys("uvw", 0.5),
    **dict.fromkeys("pqr", 0.5),
}
# Steps of the initial states by which free runs are differentiated, and rounds of Gauss and Newton.
NUDGE, ROUNDS = 1e-4, 3


def likely_states(
    model: GreyBox, windows: Windows, max_step: float | None = None, engine: str = "firm"
) -> Tensor:
    """Return the states (B, 13) from which free running follows windows best, what was measured at its measured value.

    Of the channels that were estimated and not measured alone, the initial values are those that minimise the squared
    error of the window's measured channels, each in units of its own root mean square, with a wide prior about the
    estimate: Gauss and Newton's method, the free runs differentiated by differences.

    Args:
        model: that runs freely.
        windows: B windows of the log.
        max_step: longest step of the integrator, s; None leaves it to the engine.
        engine: that makes the free runs.
    """
    initial = initial_states(model, windows)
    moving = [CHANNELS.index(n) for n in windows.estimated if n in WIDE]
    if not moving:
        return initial
    count, size = len(windows), len(moving)
    wide = torch.tensor([WIDE[CHANNELS[k]] for k in moving], dtype=initial.dtype)
    away = torch.zeros(count, size, dtype=initial.dtype)
    copies = windows.pick(np.tile(np.arange(count), size + 1))

    def change(by: Tensor) -> Tensor:
        full = torch.zeros(len(by), 12, dtype=initial.dtype)
        full[:, moving] = by
        return full

    with torch.no_grad():
        weight, best, cost = None, away, torch.full((count,), torch.inf, dtype=initial.dtype)
        for turn in range(ROUNDS + 1):
            nudged = torch.cat([away, *(away + NUDGE * e for e in torch.eye(size, dtype=initial.dtype))])
            states = moved(initial.repeat(size + 1, 1), change(nudged))
            error = _error(model, copies, states, max_step, engine).unflatten(0, (size + 1, count))
            here = error[0]
            if weight is None:
                seen = windows.mask[..., :12].sum((0, 1)).clamp(min=1.0)
                rms = torch.sqrt((torch.nan_to_num(here) ** 2).clamp(max=1e6).sum((0, 1)) / seen)
                weight = torch.where(rms > 0, 1.0 / rms.clamp(min=1e-9), torch.zeros_like(rms))
            now = ((here * weight) ** 2).sum((1, 2)) + ((away / wide) ** 2).sum(1)
            better = now < cost
            cost, best = torch.where(better, now, cost), torch.where(better[:, None], away, best)
            if turn == ROUNDS:
                break
            slope = ((error[1:] - here) / NUDGE * weight).flatten(2)
            square = torch.einsum("iba,jba->bij", slope, slope) + torch.diag(wide**-2.0)
            gradient = torch.einsum("iba,ba->bi", slope, (here * weight).flatten(1)) + away / wide**2
            sound = torch.isfinite(square).all((1, 2)) & torch.isfinite(gradient).all(1)
            eye = torch.eye(size, dtype=initial.dtype)
            step = -torch.linalg.solve(
                torch.where(sound[:, None, None], square, eye),
                torch.where(sound[:, None], gradient, 0.0 * away),
            )
            away = best + torch.where(better[:, None], step, 0.25 * (away - best))
    return moved(initial, change(best))


def _error(model: GreyBox, windows: Windows, initial: Tensor, max_step: float | None, engine: str) -> Tensor:
    """Return predicted minus measured position, attitude and velocity, (B, L, 12); zero where not measured."""
    eta, nu = predict(model, windows, initial, max_step, engine)
    seen = model.sense(Sensed(eta[..., :3], eta[..., 3:], nu))
    angle = quat_to_rotvec(quat_multiply(quat_conjugate(windows.eta[..., 3:]), seen.quaternion))
    error = torch.cat([seen.position - windows.eta[..., :3], angle, seen.nu - windows.nu], dim=-1)
    return torch.where(windows.mask[..., :12] > 0, error, torch.zeros_like(error))
