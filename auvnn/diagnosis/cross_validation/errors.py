"""Errors of free running on parts that were left out, and by how much one model errs less than another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.metrics.rollouts import Scale
from auvnn.models import GreyBox

Array = NDArray[np.float64]


# Blocks of neighbouring windows by which the uncertainty of a gain is found, at least; runs from which on they are
# left out too.
BLOCKS, MANY_RUNS = 20, 4


@dataclass(frozen=True)
class LeftOut:
    """Errors of free running over everything that was left out in turn.

    Attributes:
        names: effects that were fitted together with what is uncertain.
        horizon: of free running, s, as the comparison has it.
        scale: what errors are measured by, of the whole log.
        squared: (B, 6) sums of squared errors of each window.
        held: (B, 6) the same of holding the initial velocity.
        count: (B, 6) samples.
        run: (B,) run of each window.
        diverged: windows that left what is physical.
        models: of each fold.
        reason: why there is no figure, in words; empty where there is one.
        how: how the fits of the folds were made, in words.
    """

    names: tuple[str, ...]
    horizon: str
    scale: Scale
    squared: Array
    held: Array
    count: Array
    run: NDArray[np.int64]
    diverged: int
    models: tuple[GreyBox, ...] = field(default=(), repr=False)
    reason: str = ""
    how: str = "refitted without each fold"

    def nrmse(self, chosen: NDArray[np.bool_] | slice = slice(None), held: bool = False) -> Array:
        """Return each velocity's error over its standard deviation, (6,); NaN where it is not excited."""
        if self.reason:
            return np.where(self.scale.excited, np.inf, np.nan)
        squared = (self.held if held else self.squared)[chosen].sum(0)
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.sqrt(squared / self.count[chosen].sum(0)) / self.scale.std
        return np.where(self.scale.excited, value, np.nan)

    @property
    def total(self) -> float:
        """The mean error of the excited velocities; infinite where a fit failed."""
        return _mean(self.nrmse())

    @property
    def persistence(self) -> float:
        """The same of holding the initial velocity."""
        return _mean(self.nrmse(held=True))

    @property
    def by_dof(self) -> dict[str, float]:
        """Velocity to its error; NaN where it is not excited."""
        return {n: float(v) for n, v in zip(self.scale.names, self.nrmse(), strict=True)}

    @property
    def by_run(self) -> dict[int, float]:
        """Run to the mean error of its windows."""
        return {int(r): _mean(self.nrmse(self.run == r)) for r in np.unique(self.run)}

    def empty(self) -> LeftOut:
        """Return the same windows without any error."""
        return replace(self, squared=np.zeros_like(self.squared))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "effects": list(self.names),
            "horizon": self.horizon,
            "total": self.total,
            **self.by_dof,
            "persistence": self.persistence,
            "diverged": self.diverged,
            "runs": {str(r): v for r, v in self.by_run.items()},
            "reason": self.reason,
            "how": self.how,
        }


@dataclass(frozen=True)
class Gain:
    """By how much the error falls on what was left out.

    Attributes:
        value: fall of the total.
        std: its standard error over blocks of windows and over runs.
        by_dof: velocity to fall and standard error; only those that are excited.
        before: the total before.
        after: the total after.
        after_by_dof: velocity to the error after.
    """

    value: float
    std: float
    by_dof: dict[str, tuple[float, float]]
    before: float
    after: float
    after_by_dof: dict[str, float] = field(default_factory=dict)

    def beyond(self, errors: float = 1.0) -> bool:
        """Whether the fall is more than so many of its standard errors."""
        return bool(np.isfinite(self.value) and self.value > errors * self.std and self.value > 0.0)

    @property
    def cost(self) -> float:
        """(E without - E with) / E with, of the total."""
        return self.value / self.after if self.after > 0 else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "value": self.value,
            "std": self.std,
            "before": self.before,
            "after": self.after,
            "by_dof": {n: {"value": v, "std": s} for n, (v, s) in self.by_dof.items()},
        }


def gain(before: LeftOut, after: LeftOut) -> Gain:
    """Return by how much the error falls from one set of effects to another, over the same windows.

    The standard error is the larger of two jackknives: over blocks of neighbouring windows, and over runs where there
    are several.
    """
    if before.reason or after.reason:
        lost = -np.inf if after.reason else np.inf
        return Gain(lost, np.inf, {}, before.total, after.total)

    def falls(keep: NDArray[np.bool_]) -> Array:
        each = before.nrmse(keep) - after.nrmse(keep)
        return np.concatenate([[_mean(each)], each])

    whole = falls(np.ones(len(before.run), dtype=bool))
    std = np.zeros(7)
    groupings = [_blocks(before.run)]
    if len(np.unique(before.run)) >= MANY_RUNS:
        groupings.append(before.run)
    for group in groupings:
        values = np.array([falls(group != g) for g in np.unique(group)])
        n = len(values)
        if n < 2:
            std = np.maximum(std, np.inf)
            continue
        with np.errstate(invalid="ignore"):
            std = np.fmax(std, np.sqrt((n - 1) / n * ((values - values.mean(0)) ** 2).sum(0)))
    by_dof = {
        n: (float(whole[k + 1]), float(std[k + 1]))
        for k, n in enumerate(before.scale.names)
        if np.isfinite(whole[k + 1])
    }
    return Gain(float(whole[0]), float(std[0]), by_dof, before.total, after.total, after.by_dof)


def _blocks(run: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the block of each window: neighbours of one run."""
    runs = np.unique(run)
    each = max(-(-BLOCKS // len(runs)), 2)
    out, at = np.zeros(len(run), dtype=np.int64), 0
    for r in runs:
        own = np.flatnonzero(run == r)
        count = min(each, len(own))
        out[own] = at + np.arange(len(own)) * count // len(own)
        at += count
    return out


def _mean(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else float("nan")
