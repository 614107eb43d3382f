"""Accelerations of a model over a log, again and again as its parameters move, and their slopes."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.effects.base import HOOKS as ALL_HOOKS
from auvnn.effects.hooks import Extent
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.one_step import LogComparison
from auvnn.models import GreyBox

Array = NDArray[np.float64]

MOVED, TOUCHED = 0.25, 1e-3
"""Shares of the plausible scale by which parameters are moved to find their slopes: far where an effect is absent, for a
slope that vanishes there, as that of what goes with a square, would hide it; and little where it is at work."""


class AccelerationSlopes:
    """A log's measured states, for a model to say what accelerations it expects there.

    Args:
        model: holds the effects whose parameters will move; it is copied.
        log: measurements; spikes of single samples count as missing.
        how: how accelerations are obtained; model and data pass the same filter.
    """

    def __init__(self, model: GreyBox, log: Log, how: Derivative) -> None:
        """Read the log once."""
        self.model = model.rebuilt(model.copied_effects())
        self.runs = LogComparison.of(self.model, (run.cleaned for run in log.runs), how)

    def gap(self, hooks: Collection[str] = ALL_HOOKS) -> Array:
        """Return measured minus predicted acceleration, (N, 6); NaN where there is none.

        Args:
            hooks: of the effects whose parameters have changed since the last call.
        """
        self.runs.update(hooks)
        return self.runs.gap()

    def at(self, names: Sequence[str], theta: Array) -> Array:
        """Set parameters of effects, clipped to their bounds, and return the gap, (N, 6)."""
        set_parameters(self.model, names, theta)
        return self.gap()

    def slopes(self, names: Sequence[str], here: Array) -> Array:
        """Return d(acceleration)/d(parameter), (N, 6, P); zero for shapes, which are not moved.

        Args:
            names: effects, in order of their columns.
            here: the gap at the present parameters.
        """
        columns = []
        for name in names:
            effect = self.model.effect(name)
            theta = parameters_of(self.model, [name])
            share = MOVED if effect.absent() else TOUCHED
            for k, p in enumerate(effect.parameters_of):
                column = np.zeros_like(here)
                if not p.shape:
                    step = share * p.scale * (1.0 if theta[k] + share * p.scale <= p.high else -1.0)
                    trial = theta.copy()
                    trial[k] += step
                    set_parameters(self.model, [name], trial)
                    column = (here - self.gap(effect.hooks())) / step
                    set_parameters(self.model, [name], theta)
                columns.append(column)
            self.runs.update(effect.hooks())
        return np.stack(columns, axis=-1) if columns else np.zeros((*here.shape, 0))


def extent_of_log(log: Log) -> Extent:
    """Return how far a log reaches."""
    begin, end = min(r.t[0] for r in log.runs), max(r.t[-1] for r in log.runs)
    away = np.concatenate([np.linalg.norm(r.eta[:, :3], axis=1) for r in log.runs])
    away = away[np.isfinite(away)]
    distance = (float(np.median(away)), float(away.max())) if len(away) else (0.0, 0.0)
    runs = tuple((float(r.t[0]), float(r.t[-1])) for r in log.runs)
    return Extent(float(begin), float(end - begin), max(r.duration for r in log.runs), distance, runs)
