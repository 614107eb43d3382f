"""Free running on runs left out: what a set of effects is worth where nothing was fitted.

Each run in turn (of many, a group of them; of a single one, a fifth of its time) is left out, all that is free is fitted
to the others, and the model runs free over what was left out. The errors of all folds together are those of
`comparison.json`: windows of 5 s from measured states, in standard deviations of the measured velocities.

Reference: Stone (1974), JRSS B 36(2) 111-147 (cross-validation); Kuensch (1989), Annals of Statistics 17(3) 1217-1241
(uncertainty of correlated data by leaving out blocks).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.fitters import ByWindows, Fitter, at, fitter_for
from auvnn.diagnosis.hypotheses.bake import with_fitted_parameters
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.layout import Layout, lay_out
from auvnn.diagnosis.left_out_folds import MOST_FOLDS, Fold, folds_of
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.logs import Log
from auvnn.metrics.rollouts import Rolled, Scale, roll, scale_of
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Blocks of neighbouring windows by which the uncertainty of a gain is found, at least; runs from which on they are
# left out too.
BLOCKS, MANY_RUNS = 20, 4
# Horizons of free running, s: the longest that what is left out can bear.
HORIZONS = ("5", "2", "1", "0.5")


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
        n: (float(whole[k + 1]), float(std[k + 1])) for k, n in enumerate(before.scale.names) if np.isfinite(whole[k + 1])
    }
    return Gain(float(whole[0]), float(std[0]), by_dof, before.total, after.total, after.by_dof)


@dataclass(frozen=True)
class EachName:
    """What each of several effects is worth beside the others.

    Attributes:
        nothing: only what is uncertain refitted.
        whole: with all names.
        without: name to the errors with all names but that one.
        gains: name to the gain that it brings beside all others.
        jointly: the gain of all together.
    """

    nothing: LeftOut
    whole: LeftOut
    without: dict[str, LeftOut]
    gains: dict[str, Gain]
    jointly: Gain


def left_out_by(
    make: Callable[[Log], GreyBox], log: Log, *, names: Sequence[str] = (), most: int = MOST_FOLDS
) -> LeftOut:
    """Return the errors on what is left out of any way to make a model from a log.

    Args:
        make: returns a model fitted to the log that it is given; it never sees what is left out.
        log: the log.
        names: what to call it by.
        most: folds at most.

    Raises:
        InputError: no part that is left out is long enough to run free over it.
    """
    folds = folds_of(log, most)
    models: list[GreyBox] = []
    reason = ""
    for fold in folds:
        try:
            models.append(make(fold.fit))
        except (FitError, FloatingPointError, np.linalg.LinAlgError, SINGULAR) as problem:
            runs = ", ".join(str(r.number) for r in fold.held.runs)
            reason = f"the fit without run {runs} failed: {problem}"
            break
    return _rolled(models, log, folds, names, reason)


def left_out(
    model: GreyBox,
    log: Log,
    names: Sequence[str] = (),
    *,
    window: float | None = None,
    objective: str = "rollout",
    derivative: dict[str, Any] | None = None,
    most: int = MOST_FOLDS,
    refit: bool = True,
    progress: Callable[[str], None] | None = None,
) -> LeftOut:
    """Return the errors on what is left out, the named effects and what is uncertain refitted without it.

    Args:
        model: as known; it is not changed.
        log: the log.
        names: effects to add; none: what is uncertain alone is refitted.
        window: length of the windows that are fitted, s; by default as `add` has it.
        objective: "rollout" or "one_step": what is fitted. What is judged is free running, whatever was fitted.
        derivative: how accelerations are obtained where they were not measured.
        most: folds at most.
        refit: fit again without each fold; otherwise take one Newton step from the fit to everything, which costs
            next to nothing.
        progress: told in words what is being done.

    Raises:
        ConfigError: an unknown effect or objective.
        InputError: the log is too short.
    """
    layout = lay_out(model, list(names))
    fitter = fitter_for(model, log, objective, window=window, derivative=derivative)
    return _of_names(
        model, log, layout, fitter, names, (), None, most, refit, progress or (lambda words: None)
    )[0]


def each_name(
    model: GreyBox,
    log: Log,
    names: Sequence[str],
    *,
    window: float | None = None,
    objective: str = "rollout",
    derivative: dict[str, Any] | None = None,
    most: int = MOST_FOLDS,
    refit: bool = True,
    progress: Callable[[str], None] | None = None,
) -> EachName:
    """Return the errors on what is left out with all names, without each of them, and without any; see `left_out`."""
    say = progress or (lambda words: None)
    layout = lay_out(model, list(names))
    fitter = fitter_for(model, log, objective, window=window, derivative=derivative)

    def of(chosen: Sequence[str], absent: Sequence[str], start: FittedHypothesis | None) -> Any:
        return _of_names(model, log, layout, fitter, chosen, absent, start, most, refit, say)

    nothing, bare = of((), names, None)
    whole, found = of(names, (), bare)
    without, gains = {}, {}
    for name in names:
        others = [n for n in names if n != name]
        without[name] = of(others, (name,), found)[0] if others else nothing
        gains[name] = gain(without[name], whole)
    return EachName(nothing, whole, without, gains, gain(nothing, whole))


def _of_names(
    model: GreyBox,
    log: Log,
    layout: Layout,
    fitter: Fitter,
    names: Sequence[str],
    absent: Sequence[str],
    start: FittedHypothesis | None,
    most: int,
    refit: bool,
    say: Callable[[str], None],
) -> tuple[LeftOut, FittedHypothesis]:
    """Return the errors on what is left out with some names, and the fit to everything.

    A coefficient group that is among the names, and absent, stays as stated.
    """
    words = " and ".join(names) or "what is uncertain"
    say(f"fitting {words}")
    base = [
        n for n in layout.names if n not in (*names, *absent) or (n in layout.nuisance and n not in absent)
    ]
    found = fitter.fit(layout, base, names, start)
    out, reason = [], ""
    folds = folds_of(log, most)
    for k, fold in enumerate(folds):
        say(f"fitting {words} without part {k + 1} of {len(folds)}")
        try:
            own = fitter.without(layout, found, fold, refit)
        except (FitError, FloatingPointError, np.linalg.LinAlgError) as problem:
            runs = ", ".join(str(r.number) for r in fold.held.runs)
            reason = f"the fit without run {runs} failed: {problem}"
            break
        out.append(with_fitted_parameters(model, layout, own))
    how = "refitted without each fold" if refit else "one Newton step from the fit to all runs, for each fold"
    return _rolled(out, log, folds, names, reason, how), found


def left_out_found(
    layout: Layout,
    found: FittedHypothesis,
    windows: Windows,
    log: Log,
    *,
    refit: bool = False,
    most: int = MOST_FOLDS,
) -> LeftOut:
    """Return the errors on what is left out of an explanation that has been fitted to all windows of a log.

    Args:
        layout: stated values.
        found: the fit to all windows.
        windows: of the log.
        log: the log.
        refit: fit again without each fold; otherwise take one Newton step from the fit to everything.
        most: folds at most.

    Raises:
        InputError: no part that is left out is long enough to run free over it.
    """
    fitter, folds, out, reason = ByWindows(windows), folds_of(log, most), [], ""
    for fold in folds:
        try:
            own = fitter.without(layout, found, fold, refit)
        except (FitError, FloatingPointError, np.linalg.LinAlgError) as problem:
            reason = str(problem)
            break
        out.append(at(layout, own.names, own.fitted.theta).without_absent())
    how = "refitted without each fold" if refit else "one Newton step from the fit to all runs, for each fold"
    return _rolled(out, log, folds, found.effects, reason, how)


def _rolled(
    models: Sequence[GreyBox],
    log: Log,
    folds: Sequence[Fold],
    names: Sequence[str],
    reason: str = "",
    how: str = "refitted without each fold",
) -> LeftOut:
    """Run each fold's model free over what it has not seen."""
    scale = scale_of(log)
    nothing, none = np.zeros((0, 6)), np.zeros(0, dtype=np.int64)
    if reason:
        return LeftOut(tuple(names), "5", scale, nothing, nothing, nothing, none, 0, (), reason, how)
    for horizon in HORIZONS:
        parts = [roll(m, f.held, horizon, scale) for m, f in zip(models, folds, strict=True)]
        rolled: list[Rolled] = [p for p in parts if p is not None]
        # Runs that are too short for it do not stand in the way of those that are not.
        if len(rolled) >= max(2, (len(parts) + 1) // 2):
            break
    else:
        raise InputError(
            f"no part of {log.name} that can be left out is {HORIZONS[-1]} s long: record longer runs"
        )
    return LeftOut(
        tuple(names),
        horizon,
        scale,
        np.concatenate([r.squared for r in rolled]),
        np.concatenate([r.held for r in rolled]),
        np.concatenate([r.count for r in rolled]),
        np.concatenate([r.windows.run for r in rolled]).astype(np.int64),
        int(sum(r.diverged.sum() for r in rolled)),
        tuple(models),
        "",
        how,
    )


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
