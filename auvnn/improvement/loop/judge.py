"""Free running on what was left out: the one figure by which every step of the loop is accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.cross_validation.errors import LeftOut
from auvnn.errors import InputError
from auvnn.improvement.free_run import Task, predicted
from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.folds import Folds
from auvnn.metrics.regression import Regression
from auvnn.metrics.rollouts import WARMUP, Scale, scale_of, scored
from auvnn.metrics.windows import Windows, cut_windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Horizons of free running, s, longest first: the first that leaves enough windows is judged by.
HORIZONS, ENOUGH = ("5", "2", "1", "0.5"), 12
# Windows that are fitted: more cost time and say little more.
FITTED = 240
NEWTON = "one Newton step from the fit to everything, for each fold"


@dataclass(frozen=True)
class Judge:
    """Windows of a log, its folds, and what errors are measured by.

    Attributes:
        log: what is fitted to.
        kind: which commands drive the model.
        horizon: of free running, s.
        windows: B windows of that length, a new one every half.
        scale: each velocity's standard deviation.
        folds: what is left out in turn.
        own: (B,) fold of each window.
        free: (B, F) whether it shares nothing with each fold.
        driven: the model that states how commands go between samples; None where they are held.
    """

    log: Log
    kind: str
    horizon: str
    windows: Windows
    scale: Scale
    folds: Folds
    own: NDArray[np.int64]
    free: NDArray[np.bool_]
    driven: GreyBox | None = None

    @classmethod
    def of(cls, log: Log, kind: str, driven: GreyBox | None = None) -> Judge:
        """Cut a log.

        Args:
            log: what is fitted to.
            kind: which commands drive the model.
            driven: the model that states how commands go between samples; None where they are held.

        Raises:
            InputError: no stretch of it is long enough to run free over.
        """
        windows, horizon = None, HORIZONS[-1]
        for horizon in HORIZONS:
            try:
                windows = cut_windows(log, float(horizon), float(horizon) / 2, warmup=WARMUP, kind=kind)
            except InputError:
                continue
            if len(windows) >= ENOUGH:
                break
        if windows is None or len(windows) < 4:
            raise InputError(
                f"{log.name} has hardly a stretch of {HORIZONS[-1]} s without a gap: record a longer log"
            )
        windows = windows if driven is None else as_stated(driven, windows)
        folds = Folds.of(log)
        own, free = folds.windows(windows)
        return cls(log, kind, horizon, windows, scale_of(log), folds, own, free, driven)

    def task(self, seconds: float) -> tuple[Task, NDArray[np.int64], NDArray[np.bool_]]:
        """Return windows of a length to fit, their folds, and (B, F) which share nothing with each fold.

        Args:
            seconds: length; there are at most `FITTED` of them, evenly spread.
        """
        windows = self.windows
        if seconds != float(self.horizon):
            windows = cut_windows(self.log, seconds, seconds / 2, warmup=WARMUP, kind=self.kind)
            windows = windows if self.driven is None else as_stated(self.driven, windows)
        if len(windows) > FITTED:
            windows = windows.pick(np.linspace(0, len(windows) - 1, FITTED).round().astype(int))
        return Task(windows, self.scale), *self.folds.windows(windows)

    def left_out(self, models: Mapping[int, GreyBox], names: Sequence[str], how: str = NEWTON) -> LeftOut:
        """Return the errors of models, one for each fold, over what each has not seen.

        Args:
            models: by the number of the fold that each has not seen.
            names: effects in them.
            how: how they were fitted without the fold, in a word.
        """
        seen = np.full(tuple(self.windows.nu.shape), np.nan)
        for fold, model in models.items():
            chosen = np.flatnonzero(self.own == fold)
            if len(chosen):
                seen[chosen] = predicted(model, self.windows.pick(chosen))
        return self.scored(seen, names, how)

    def scored(self, seen: Array, names: Sequence[str], how: str) -> LeftOut:
        """Return the errors of predictions (B, L, 6).

        Args:
            seen: predicted velocity, (B, L, 6), m/s and rad/s; NaN where there is none.
            names: effects in the models.
            how: how they were fitted without the fold, in a word.
        """
        r = scored(self.windows, seen, self.scale)
        return LeftOut(
            tuple(names), self.horizon, self.scale, r.squared, r.held, r.count,
            self.windows.run.astype(np.int64), int(r.diverged.sum()), (), "", how,
        )  # fmt: skip

    def as_it_is(self, model: GreyBox) -> LeftOut:
        """Return the errors of a model that was not fitted to this log at all."""
        return self.scored(predicted(model, self.windows), (), "nothing was fitted")

    def regression(self, how: Derivative) -> LeftOut:
        """Return the errors of the plain regression, each fold predicted by the others."""
        found = Regression.of(self.log, self.kind, how, self.folds)
        return self.scored(found.predict(self.windows, left_out=True), (), "refitted without each fold")
