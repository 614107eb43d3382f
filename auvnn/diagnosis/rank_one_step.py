"""Which effect pays one step ahead? The whole catalogue by accelerations, judged on parts of the log left out.

Where waves, held samples or a tank's own flow limit a free run, errors one step ahead tell more than those of free
running. Each effect's share of the acceleration is linear in its parameters for small ones: its columns are found by
moving them from the null, and fitted beside those of the uncertain coefficients, each within its prior. What is left
out is a fifth of every run in turn, so that every part of the fit has seen every kind of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.answers import plain
from auvnn.diagnosis.cut import candidates_for
from auvnn.diagnosis.nuisance import FREE, stated
from auvnn.effects import effect_class
from auvnn.logs import Log
from auvnn.metrics.one_step import accelerations, choose_derivative
from auvnn.models import GreyBox

Array = NDArray[np.float64]

FIFTHS = 5
MOVED = 0.25  # of the plausible scale by which a parameter is moved to find its column
BLOCK = 5.0  # s of neighbouring samples that count as one when a gain's uncertainty is judged
ROUNDS = 3
# Linearisations at most, and the step, in plausible scales, below which one more is not needed.
LINEARISED, SETTLED = 4, 0.05


@dataclass(frozen=True)
class Ranked:
    """What one effect gains one step ahead.

    Args:
        effect: its name.
        before: weighted squared error per sample on what was left out, without it.
        after: with it.
        std: standard error of the difference.
        values: its parameters, as linearised from the null, by name.
        behind: by how much its error is larger than that of the best.
        behind_std: standard error of that.
    """

    effect: str
    before: float
    after: float
    std: float
    values: dict[str, float]
    behind: float = 0.0
    behind_std: float = 0.0

    @property
    def tied(self) -> bool:
        """Whether the best is better by no more than the uncertainty of the difference: one group with it."""
        return self.behind <= self.behind_std

    @property
    def gain(self) -> float:
        """By how much the error falls."""
        return self.before - self.after

    @property
    def pays(self) -> bool:
        """Whether it falls by more than its own uncertainty."""
        return self.gain > self.std

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        names = ("effect", "before", "after", "std", "values", "gain", "pays", "behind", "behind_std", "tied")
        return plain({n: getattr(self, n) for n in names})


def rank_one_step(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    derivative: Any = None,
    progress: Callable[[str], None] | None = None,
) -> list[Ranked]:
    """Rank effects by what they gain one step ahead on parts of the log left out, best first.

    Args:
        model: the model, without them.
        log: measurements.
        effects: names to consider; the whole catalogue by default.
        derivative: how accelerations are obtained, as `compare` takes it.
        progress: told in words what is being done.

    Raises:
        ConfigError: an unknown effect.
        InputError: the log lacks the commands that drive the model.
    """
    say = progress or (lambda words: None)
    how = choose_derivative(log, derivative)
    usable, _ = candidates_for(model, log, effects)

    def predicted(of: GreyBox) -> Array:
        return np.concatenate([accelerations(of, run, how)[1] for run in log.runs])

    measured, base = (
        np.concatenate(x) for x in zip(*(accelerations(model, r, how) for r in log.runs), strict=True)
    )
    groups = stated(model)
    columns_of = {name: _columns(model, name, predicted, base) for name in groups}
    block, fifth = _parts(log)
    gap = measured - base
    good = np.isfinite(gap).all(1)
    for columns, _, _ in columns_of.values():
        good &= np.isfinite(columns).all((1, 2))
    nuisance, prior = _joined(columns_of, groups, len(base))
    weight = np.zeros_like(gap)
    weight[good] = _weights(gap[good], nuisance[good], prior)
    found, errors = [], {}
    for name in usable:
        say(f"trying {name}")
        columns, null, scale = columns_of.get(name) or _columns(model, name, predicted, base)
        # A group's stated uncertainty is given up while the group itself is asked for.
        others, narrow = _joined({g: c for g, c in columns_of.items() if g != name}, groups, len(base))
        rows = good & np.isfinite(columns).all((1, 2))
        if rows.sum() < 0.5 * good.sum() or not np.abs(columns[rows]).max() > 0.0:
            continue
        loose = np.concatenate([narrow, FREE * scale])
        before = _left_out(gap[rows], nuisance[rows], prior, weight[rows], fifth[rows])
        described = effect_class(name).describe(model.vehicle, model.actuation)
        at, left, mean = null.copy(), gap, np.zeros(len(loose))
        # Where an effect is large its square counts too: it is linearised again where the fit has come to.
        for again in range(LINEARISED):
            x = np.concatenate([others[rows], columns[rows]], axis=-1)
            step = _solve(left[rows], x, loose, weight[rows], mean)[len(narrow) :]
            if again == LINEARISED - 1 or np.all(np.abs(step) < SETTLED * scale):
                break
            at = np.clip(at + step, [p.low for p in described], [p.high for p in described])
            there = {p.name: float(v) for p, v in zip(described, at, strict=True)}
            with torch.no_grad():
                now = predicted(model.with_effects({name: there}))
            moved, _, _ = _columns(model, name, predicted, now, there)
            if not (np.isfinite(now[rows]).all() and np.isfinite(moved[rows]).all()):
                break
            columns, left = moved, measured - now
            mean = np.concatenate([np.zeros(len(narrow)), null - at])
        after = _left_out(left[rows], x, loose, weight[rows], fifth[rows], mean)
        values = {p.name: float(v) for p, v in zip(described, at + step, strict=True)}
        std = _standard_error(before - after, block[rows])
        found.append(Ranked(name, float(before.mean()), float(after.mean()), std, values))
        errors[name] = np.full(len(gap), np.nan)
        errors[name][rows] = before - after
    found.sort(key=lambda r: -r.gain)
    return [
        r if r is found[0] else _behind(r, errors[found[0].effect] - errors[r.effect], block) for r in found
    ]


def _behind(ranked: Ranked, difference: Array, block: NDArray[np.int64]) -> Ranked:
    """Return an effect with how far its gain is behind that of the best, over the samples that both have."""
    both = np.isfinite(difference)
    if not both.any():
        return replace(ranked, behind=float("inf"))
    std = _standard_error(difference[both], block[both])
    return replace(ranked, behind=float(difference[both].mean()), behind_std=std)


def _joined(
    columns_of: Mapping[str, tuple[Array, Array, Array]], groups: Mapping[str, float], samples: int
) -> tuple[Array, Array]:
    """Return the columns of several coefficient groups side by side, (N, 6, m), and their stated spreads, (m,)."""
    columns = [np.zeros((samples, 6, 0)), *(c for c, _, _ in columns_of.values())]
    spread = [np.zeros(0), *(np.full(c.shape[-1], groups[g]) for g, (c, _, _) in columns_of.items())]
    return np.concatenate(columns, axis=-1), np.concatenate(spread)


def _standard_error(difference: Array, block: NDArray[np.int64]) -> float:
    """Return the standard error of a mean over samples of which those of one block count as one."""
    _, index = np.unique(block, return_inverse=True)
    sums = np.bincount(index, difference)
    return float(np.sqrt(len(sums)) * sums.std(ddof=1)) / len(difference) if len(sums) > 1 else float("inf")


def _columns(
    model: GreyBox,
    name: str,
    predicted: Callable[[GreyBox], Array],
    base: Array,
    at: Mapping[str, float] | None = None,
) -> tuple[Array, Array, Array]:
    """Return d(acceleration)/d(parameter) of an effect, (N, 6, p), its nulls and its plausible scales, (p,).

    The slopes are those at the null, or where `at` says; `base` is what the model predicts there.
    """
    kind = effect_class(name)
    described = kind.describe(model.vehicle, model.actuation)
    columns = []
    for parameter in described:
        step, here = MOVED * parameter.scale, (at or {}).get(parameter.name, parameter.null)
        if not parameter.low <= here + step <= parameter.high:
            step = -step
        if parameter.shape:
            columns.append(np.zeros_like(base))
            continue
        with torch.no_grad():
            moved = predicted(model.with_effects({name: {**(at or {}), parameter.name: here + step}}))
        columns.append((moved - base) / step)
    null, scale = (np.array([getattr(p, k) for p in described]) for k in ("null", "scale"))
    return np.stack(columns, axis=-1), null, scale


def _parts(log: Log) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return block and fifth of each sample, (N,): fifths of every run's own time."""
    blocks, fifths, first = [], [], 0
    for run in log.runs:
        since = run.t - run.t[0]
        own = (since / BLOCK).astype(int)
        blocks.append(first + own)
        fifths.append(np.minimum(FIFTHS * since / max(run.duration, 1e-9), FIFTHS - 1).astype(int))
        first += int(own.max()) + 1
    return np.concatenate(blocks), np.concatenate(fifths)


def _solve(gap: Array, x: Array, spread: Array, weight: Array, mean: Array | float = 0.0) -> Array:
    """Return the parameters' departures that fit the gap best within their priors about `mean`, (p,)."""
    square = np.einsum("nik,ni,nil->kl", x, weight, x, optimize=True) + np.diag(spread**-2.0)
    right = np.einsum("nik,ni,ni->k", x, weight, gap, optimize=True) + spread**-2.0 * mean
    scale = 1.0 / np.sqrt(np.diag(square))
    return scale * np.linalg.solve(square * np.outer(scale, scale), scale * right)


def _weights(gap: Array, x: Array, spread: Array) -> Array:
    """Return weights (N, 6) by which each degree of freedom counts alike and outliers count little (Huber)."""
    weight = np.ones_like(gap) / np.maximum((gap**2).mean(0), 1e-300)
    for _ in range(ROUNDS):
        left = gap - x @ _solve(gap, x, spread, weight) if x.shape[-1] else gap
        sigma = 1.4826 * np.median(np.abs(left), axis=0) + 1e-12
        weight = 1.0 / np.maximum(1.0, np.abs(left) / (3.0 * sigma)) / sigma**2
    return weight


def _left_out(
    gap: Array, x: Array, spread: Array, weight: Array, fifth: NDArray[np.int64], mean: Array | float = 0.0
) -> Array:
    """Return each sample's weighted squared error by the fit on the other fifths, (N,)."""
    out = np.zeros(len(gap))
    for k in range(FIFTHS):
        held = fifth == k
        if not held.any() or held.all():
            continue
        theta = _solve(gap[~held], x[~held], spread, weight[~held], mean)
        out[held] = (weight[held] * (gap[held] - x[held] @ theta) ** 2).sum(1)
    return out
