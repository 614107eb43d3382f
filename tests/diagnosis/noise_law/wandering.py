"""Logs of the small vehicle with an Ornstein-Uhlenbeck wrench that no model has, made step by step."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.logs import Log
from auvnn.models import GreyBox
from tests.small_logs import make_log

STEP = 0.05


def path(rms, time, duration: float, seed, step: float = STEP) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck path in six degrees of freedom, (T, 6), by its exact discretisation."""
    random = np.random.default_rng(seed)
    rms, time = np.broadcast_to(rms, 6), np.broadcast_to(time, 6)
    keep = np.exp(-step / time)
    drawn = random.normal(size=(int(np.ceil(duration / step)) + 2, 6))
    out = rms * drawn
    for k in range(1, len(out)):
        out[k] = keep * out[k - 1] + np.sqrt(1 - keep**2) * rms * drawn[k]
    return out


class Wander(Effect):
    """A wrench along a path (T, 6), or along one for each of many windows alike (T, B, 6), on straight lines."""

    name = "wander"
    cause = "made up for a test"
    symbol = "f"
    reference = "none"

    def __init__(self, values: np.ndarray, step: float = STEP) -> None:
        super().__init__((Parameter("size", "1", 0.0, 1.0, -1e3, 1e3),))
        with torch.no_grad():
            self.theta.fill_(1.0)
        self.keep("path", values)
        self.step = step

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        values = self.kept("path")
        at = (torch.as_tensor(moment.time) / self.step).clamp(0, len(values) - 1.001)
        if values.ndim == 3:
            # The windows are alike: so are their times.
            at = at.flatten()[0]
        k = at.floor().long()
        share = (at - k).unsqueeze(-1)
        force = (1 - share) * values[k] + share * values[k + 1]
        return self.theta[0] * force.expand(*moment.nu.shape[:-1], 6)


def wandering_log(
    model: GreyBox, rms, time, *, runs: int = 4, duration: float = 40.0, rate: float = 10.0, seed: int = 0
) -> Log:
    """Return a log with realistic noise; every run has a path of its own."""
    made = []
    for number in range(runs):
        members = [*model.copied_effects()]
        if np.any(np.asarray(rms) > 0):
            members.append(Wander(path(rms, time, duration, [seed, number])))
        moved = GreyBox(model.vehicle, members, None, model.actuation)
        made += make_log(moved, runs=1, first=number, duration=duration, rate=rate, noise=1.0, seed=seed).runs
    return Log.from_runs(made, name=f"wandering-{seed}")
