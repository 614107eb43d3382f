"""By how much free running improves, how sure that is, and what nothing can improve on."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.logs import Log
from auvnn.metrics.free_run import initial_states, moved, predict
from auvnn.metrics.noise import attitude_noise, white
from auvnn.metrics.rollouts import Rolled, Scale
from auvnn.models import GreyBox

Array = NDArray[np.float64]
BLOCKS = 20


def paired_gain(before: Rolled, after: Rolled, scale: Scale) -> tuple[float, float]:
    """Return by how much the total error falls, and its standard error by leaving out blocks of windows.

    Blocks of neighbouring windows hold the correlation within them (Kuensch 1989, Annals of Statistics 17(3)).
    """
    value = before.total(scale) - after.total(scale)
    count = len(before.windows)
    block = np.arange(count) * min(BLOCKS, count) // max(count, 1)
    without = [before.total(scale, block != b) - after.total(scale, block != b) for b in np.unique(block)]
    n = len(without)
    if n < 2:
        return value, float("inf")
    return value, float(np.sqrt((n - 1) / n * np.sum((np.array(without) - np.mean(without)) ** 2)))


def noise_floor(model: GreyBox, rolled: Rolled, log: Log, scale: Scale, seed: int = 0) -> float:
    """Return the free-running error that a perfect model would show: noise of the outputs and of the start.

    The model's own predictions stand for the truth; they are started again from states with noise as large
    as the log's and compared with noisy copies of themselves.
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
        true = predict(model, windows, states)[1].numpy()
        started = predict(model, windows, moved(states, torch.as_tensor(kick)))[1].numpy()
    error = true + rng.normal(size=true.shape) * noise_nu - started
    mask = windows.mask[..., 6:12].numpy().copy()
    mask[:, 0] = 0.0
    good = np.isfinite(error).all((1, 2))
    if not good.any():
        return float("nan")
    squared = (error[good] ** 2 * mask[good]).sum((0, 1)) / np.maximum(mask[good].sum((0, 1)), 1.0)
    value = np.sqrt(squared) / np.where(scale.std > 0, scale.std, np.nan)
    return float(np.nanmean(value[scale.excited])) if scale.excited.any() else float("nan")
