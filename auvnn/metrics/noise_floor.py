"""The free-running error that nothing can improve on: noise of the outputs and of the start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from auvnn.effects import Sensed
from auvnn.logs import Log
from auvnn.metrics.coordinates import coordinates, spread
from auvnn.metrics.free_run import initial_states, moved, predict
from auvnn.metrics.noise import attitude_noise, white
from auvnn.metrics.rollouts import Rolled, Scale
from auvnn.models import GreyBox


def noise_floor(
    model: GreyBox, rolled: Rolled, log: Log, scale: Scale, seed: int = 0, engine: str = "torch"
) -> float:
    """Return the free-running error that a perfect model would show: noise of the outputs and of the start.

    The model's own predictions stand for the truth; they are started again from states with noise as large
    as the log's and compared with noisy copies of themselves.

    Args:
        model: that stands for the truth.
        rolled: its free runs.
        log: whose noise is taken.
        scale: of the velocities, by which errors become comparable.
        seed: of the noise.
        engine: as in `rollout`.
    """
    noise_nu = np.mean([white(r, r.nu) for r in log.runs], axis=0)
    angle = np.mean([attitude_noise(r) for r in log.runs], axis=0)
    rng = np.random.default_rng(seed)
    windows = rolled.windows
    states = initial_states(model, windows)
    kick = np.concatenate(
        [
            np.zeros((len(windows), 3)),
            rng.normal(size=(len(windows), 3)) * angle,
            rng.normal(size=(len(windows), 6)) * noise_nu,
        ],
        axis=1,
    )
    with torch.no_grad():
        eta, nu = predict(model, windows, states, engine=engine)
        eta_started, nu_started = predict(model, windows, moved(states, torch.as_tensor(kick)), engine=engine)
    true, started = nu.numpy(), nu_started.numpy()
    error = true + rng.normal(size=true.shape) * noise_nu - started
    mask = windows.mask[..., 6:12].numpy().copy()
    # The model's own run stands for the measurements.
    itself = replace(windows, eta=eta, mask=windows.mask)
    instead = coordinates(itself, Sensed(eta_started[..., :3], eta_started[..., 3:], nu_started), scale.names)
    if instead is not None:
        rough = spread(log, scale.names)[1][instead.places]
        error[..., instead.places] = instead.gap + rng.normal(size=instead.gap.shape) * np.nan_to_num(rough)
        mask[..., instead.places] = instead.mask
    mask[:, 0] = 0.0
    good = np.isfinite(error).all((1, 2))
    if not good.any():
        return float("nan")
    squared = (error[good] ** 2 * mask[good]).sum((0, 1)) / np.maximum(mask[good].sum((0, 1)), 1.0)
    value = np.sqrt(squared) / np.where(scale.std > 0, scale.std, np.nan)
    return float(np.nanmean(value[scale.excited])) if scale.excited.any() else float("nan")
