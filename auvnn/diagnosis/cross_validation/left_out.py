"""Free running on runs left out: what a set of effects is worth where nothing was fitted.

Each run in turn (of many, a group of them; of a single one, a fifth of its time) is left out, all that is free is fitted
to the others, and the model runs free over what was left out. The errors of all folds together are those of
`comparison.json`: windows of 5 s from measured states, in standard deviations of the measured velocities.

Reference: Stone (1974), JRSS B 36(2) 111-147 (cross-validation); Kuensch (1989), Annals of Statistics 17(3) 1217-1241
(uncertainty of correlated data by leaving out blocks).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.cross_validation.errors import Gain, LeftOut, gain
from auvnn.diagnosis.cross_validation.fitters import ByWindows, Fitter, at, fitter_for
from auvnn.diagnosis.cross_validation.folds import MOST_FOLDS, Fold, folds_of
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.put_into_model import with_fitted_parameters
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.logs import Log
from auvnn.metrics.rollouts import Rolled, roll, scale_of
from auvnn.metrics.unmeasured import completed
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.progress import Progress

Array = NDArray[np.float64]
# Horizons of free running, s: the longest that what is left out can bear.
HORIZONS = ("5", "2", "1", "0.5")


@dataclass(frozen=True)
class EachName:
    """What each of several effects is worth in addition to the others.

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
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown effect or objective.
        InputError: the log is too short.
    """
    log = completed(model, log)
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
    """Return the errors on what is left out with all names, without each of them, and without any; see `left_out`.

    Args:
        model: as known.
        log: measurements, left out part by part.
        names: effects that are judged.
        window: length of the windows that are fitted, s; chosen by the log where None.
        objective: "rollout" or "one_step".
        derivative: how accelerations are obtained, for "one_step".
        most: most parts into which the log is cut.
        refit: fit again without each part; by one Newton step where false.
        progress: called with what is being done, in words.
    """
    say = progress or (lambda words: None)
    log = completed(model, log)
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
    folds = folds_of(log, most)
    say(Progress(f"fitting {words}", 0, len(folds) + 1))
    base = [
        n for n in layout.names if n not in (*names, *absent) or (n in layout.nuisance and n not in absent)
    ]
    found = fitter.fit(layout, base, names, start)
    out, reason = [], ""
    for k, fold in enumerate(folds):
        say(Progress(f"fitting {words} without part {k + 1} of {len(folds)}", k + 1, len(folds) + 1))
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
