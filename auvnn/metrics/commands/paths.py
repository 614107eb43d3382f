"""Commands between samples as weights of the samples beside them, and windows of commands that go so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import torch
from scipy.stats import binom
from torch import Tensor

from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.windows import Windows
from auvnn.models.free_running.rollout import steps_per_interval

# Places within an interval and their weights: exact up to the seventh power of the time.
PLACES, WEIGHTS = (
    x / 2.0 + shift for x, shift in zip(np.polynomial.legendre.leggauss(4), (0.5, 0.0), strict=True)
)
# Moments as weights of neighbouring samples, and the weights of the moments; and what gives them of part of an interval.
Moments = tuple[Sequence[tuple[float, ...]], tuple[float, ...]]
Law = Callable[[float, tuple[float, float]], Moments]


def between(
    windows: Windows,
    share: float,
    along: str = "ahead",
    *,
    samples: int = 0,
    curves: MeanThrust | None = None,
) -> Windows:
    """Return windows whose commands and fins have the means that they take between samples.

    Args:
        windows: of commands that are held.
        share: of the next sample's command in an interval's mean.
        along: "ahead" for commands that change once, "linear" for the straight line through two samples, whatever the
            share, "smooth" for the cubic through four.
        samples: in the mean with binomial weights, an even number; zero for the share's own law.
        curves: of the thrusters: the command whose thrust is the mean thrust is returned, but for a mean with binomial
            weights, which takes noise out of the commands.
    """
    if share == 0.0 and along == "ahead" and not samples:
        return windows
    given = windows.inputs
    if samples:
        weights = binomial_weights(samples)
        fins = None if given.fins is None else _along(given.fins, weights)
        return replace(windows, inputs=replace(given, command=_along(given.command, weights), fins=fins))
    law = LAWS[along]
    parts = steps_per_interval(windows.times, windows.max_step)
    edges = np.arange(parts + 1) / parts

    def of(values: Tensor | None, curves: MeanThrust | None) -> tuple[Tensor | None, Tensor | None]:
        if values is None:
            return None, None
        each = [_mean(values, law, share, (a, b), curves) for a, b in pairwise(edges)] if parts > 1 else None
        whole = _mean(values, law, share, (0.0, 1.0), curves)
        return whole, None if each is None else torch.stack(each, dim=-2)

    command, within = of(given.command, curves)
    assert command is not None
    fins, fins_within = of(given.fins, None)
    inputs = replace(given, command=command, fins=fins, within=within, fins_within=fins_within)
    return replace(windows, inputs=inputs)


def _mean(
    values: Tensor, law: Law, share: float, part: tuple[float, float], curves: MeanThrust | None
) -> Tensor:
    """Return what stands for a part of every interval, from begin to end as shares of it."""
    moments, weights = law(share, part)
    if curves is not None and curves.through_thrusts:
        # Of thrusts the mean over the path is one weighted sum of those of the samples.
        whole = [
            sum(w * m for w, m in zip(weights, each, strict=True)) for each in zip(*moments, strict=True)
        ]
        return curves.command_for(_neighbours(values, len(whole)), whole)
    paths = [_along(values, moment) for moment in moments]
    if curves is not None:
        return curves.command_for(paths, weights)
    return torch.stack([w * x for w, x in zip(weights, paths, strict=True)]).sum(0)


def _along(values: Tensor, weights: Sequence[float]) -> Tensor:
    """Return sums of neighbouring samples, (B, L, n), half of the weights before the middle of each interval."""
    near = _neighbours(values, len(weights))
    return torch.stack([w * x for w, x in zip(weights, near, strict=True)]).sum(0)


def _neighbours(values: Tensor, count: int) -> list[Tensor]:
    """Return as many neighbouring samples of each interval, (B, L, n) each, half of them before its middle."""
    before, after = count // 2 - 1, count // 2
    ends = values[:, :1].expand(-1, before, -1), values[:, -1:].expand(-1, after, -1)
    whole = torch.cat([ends[0], values, ends[1]], dim=1)
    return [whole[:, j : j + values.shape[1]] for j in range(count)]


def binomial_weights(samples: int) -> tuple[float, ...]:
    """Return binomial weights of so many samples, half of them before the middle of an interval, half after it."""
    return tuple(float(w) for w in binom.pmf(np.arange(samples), samples - 1, 0.5))


def cubic_at(share: float, part: tuple[float, float]) -> Moments:
    """Return weights of samples -1, 0, 1, 2 in the cubic through them, at moments of a part of an interval.

    Args:
        share: by how much the interval is moved, less one half.
        part: begin and end, as shares of the interval.
    """
    at = (-1.0, 0.0, 1.0, 2.0)
    times = share - 0.5 + part[0] + (part[1] - part[0]) * PLACES
    weights = [tuple(float(np.prod([(t - m) / (j - m) for m in at if m != j])) for j in at) for t in times]
    return weights, tuple(WEIGHTS)


def line_at(share: float, part: tuple[float, float]) -> Moments:
    """Return the same of samples 0 and 1 on the straight line between them, whatever the share."""
    times = part[0] + (part[1] - part[0]) * PLACES
    return [(1.0 - t, t) for t in times], tuple(WEIGHTS)


def step_at(share: float, part: tuple[float, float]) -> Moments:
    """Return the same of commands that change from sample 0 to sample 1 when that share of the interval is left."""
    after = float(np.clip(part[1] - (1.0 - share), 0.0, part[1] - part[0]) / (part[1] - part[0]))
    return [(1.0, 0.0), (0.0, 1.0)], (1.0 - after, after)


LAWS: dict[str, Law] = {"ahead": step_at, "linear": line_at, "smooth": cubic_at}
