"""The two ways in which explanations are fitted: by windows of free running, or one step ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.diagnosis.cross_validation.folds import Fold
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, priors
from auvnn.diagnosis.one_step.fit import fit_hypothesis_one_step
from auvnn.diagnosis.score_tests.shape_search import searched_start
from auvnn.errors import ConfigError
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.prediction_error import Fitted, fit
from auvnn.estimation.priors import limits, parameters_of, set_parameters
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative, choose_derivative
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

OBJECTIVES = ("rollout", "one_step")
# Steps of a fit that begins next to where it ends: the same log but for one fold.
FEW_STEPS = 6


class Fitter(Protocol):
    """Fits effects and what is uncertain to a log, and to a log without one of its folds."""

    def fit(
        self, layout: Layout, base: Sequence[str], effects: Sequence[str], start: FittedHypothesis | None
    ) -> FittedHypothesis:
        """Fit effects jointly with what is free anyway.

        Args:
            layout: stated values.
            base: effects that are free anyway.
            effects: effects asked for.
            start: a fit to go out from.
        """
        ...

    def without(self, layout: Layout, found: FittedHypothesis, fold: Fold, refit: bool) -> FittedHypothesis:
        """Fit the same again without a fold; where not `refit`, by one Newton step from the fit to everything.

        Args:
            layout: stated values.
            found: the fit to everything.
            fold: part of the log that is left out.
            refit: whether to fit in full.
        """
        ...


def fitter_for(
    model: GreyBox,
    log: Log,
    objective: str = "rollout",
    *,
    window: float | None = None,
    derivative: dict[str, Any] | None = None,
) -> Fitter:
    """Return who fits by an objective.

    Args:
        model: that is to be fitted, for its actuation.
        log: measurements.
        objective: "rollout" (windows run free) or "one_step" (accelerations).
        window: length of the windows, s; chosen by the log where None.
        derivative: how accelerations are obtained, for "one_step".

    Raises:
        ConfigError: an unknown objective, or a window for one that has none.
        InputError: the log is too short for windows.
    """
    if objective not in OBJECTIVES:
        raise ConfigError(unknown_name("objective", str(objective), OBJECTIVES))
    if objective == "one_step":
        if window is not None:
            raise ConfigError("window= belongs to objective=rollout: leave it out, or fit windows")
        # The slope of a velocity that leaves its neighbours for one sample is no acceleration.
        cleaned = replace(log, runs=tuple(run.cleaned for run in log.runs))
        return OneStep(cleaned, choose_derivative(log, derivative))
    return ByWindows(windows_for(model, log, window))


@dataclass(frozen=True)
class ByWindows:
    """Fits the error of free-running windows.

    Attributes:
        windows: of the log.
    """

    windows: Windows

    def fit(
        self, layout: Layout, base: Sequence[str], effects: Sequence[str], start: FittedHypothesis | None
    ) -> FittedHypothesis:
        """Fit from measured states, or from another fit's; see `Fitter`.

        Args:
            layout: stated values.
            base: effects that are free anyway.
            effects: that are asked for, the newest last.
            start: a fit to go on from; measured states where None.
        """
        if start is None:
            return fit_hypothesis(layout, self.windows, base, effects)
        guess = None
        if effects and effects[-1] not in start.names:
            guess = searched_start(layout, self.windows, start, base, effects[-1])
        if guess is None:
            guess = started(layout, start, [*base, *effects])
        return fit_hypothesis(layout, self.windows, base, effects, start=start.fitted, guess=guess)

    def without(self, layout: Layout, found: FittedHypothesis, fold: Fold, refit: bool) -> FittedHypothesis:
        """Fit again without the windows that share a sample with a fold; see `Fitter`.

        Args:
            layout: stated values.
            found: the fit to everything.
            fold: part of the log that is left out.
            refit: whether to fit in full after the Newton step.
        """
        keep = ~within(self.windows, fold.held)
        if not keep.any():
            raise FloatingPointError("nothing is left to fit to")
        fitted = found.fitted
        held = priors(layout, found.names, free=found.effects)
        theta = newton(fitted, held, keep)
        if not refit:
            return replace(found, fitted=replace(fitted, theta=theta))
        model = at(layout, found.names, theta)
        own = fit(
            model,
            self.windows.pick(keep),
            found.names,
            held,
            initial=fitted.initial[torch.as_tensor(keep)],
            sigma=fitted.sigma,
            iterations=FEW_STEPS,
        )
        return replace(found, fitted=own)


@dataclass(frozen=True)
class OneStep:
    """Fits accelerations one step ahead.

    Attributes:
        log: without spikes.
        how: how accelerations are obtained.
    """

    log: Log
    how: Derivative

    def fit(
        self, layout: Layout, base: Sequence[str], effects: Sequence[str], start: FittedHypothesis | None
    ) -> FittedHypothesis:
        """Fit all samples; see `Fitter`.

        Args:
            layout: stated values.
            base: effects that are free anyway.
            effects: that are asked for; none may have a shape.
            start: a fit to go on from, or None.

        Raises:
            ConfigError: an effect has a time or a shape to be found.
        """
        _shapeless(layout, effects)
        return fit_hypothesis_one_step(
            layout, self.log, base, effects, self.how, start=None if start is None else start.fitted
        )

    def without(self, layout: Layout, found: FittedHypothesis, fold: Fold, refit: bool) -> FittedHypothesis:
        """Fit the other samples, always in full: it is cheap; see `Fitter`.

        Args:
            layout: stated values.
            found: the fit to everything.
            fold: part of the log that is left out.
            refit: not used: the fit is always in full.
        """
        log = replace(fold.fit, runs=tuple(run.cleaned for run in fold.fit.runs))
        base = [n for n in found.names if n not in found.effects]
        return fit_hypothesis_one_step(layout, log, base, found.effects, self.how, start=found.fitted)


def _shapeless(layout: Layout, effects: Sequence[str]) -> None:
    for name in effects:
        if any(p.shape for p in layout.model.effect(name).parameters_of):
            raise ConfigError(
                f"{name} has a time or a shape to be found, which objective=one_step cannot: take objective=rollout"
            )


def at(layout: Layout, names: Sequence[str], theta: NDArray[np.float64]) -> GreyBox:
    """Return the layout's model with some effects at given values.

    Args:
        layout: stated values.
        names: effects, in the order of `theta`.
        theta: their parameters side by side, (P,).
    """
    model = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(model, names, theta)
    return model


def started(layout: Layout, found: FittedHypothesis, names: Sequence[str]) -> Layout:
    """Return the layout with those of some effects that a fit holds where it has them.

    Args:
        layout: stated values.
        found: a fit.
        names: effects that take the fit's values where it has them.
    """
    model = layout.model.rebuilt(layout.model.copied_effects())
    for name in names:
        if name in found.names:
            set_parameters(model, [name], parameters_of(found.fitted.model, [name]))
    return replace(layout, model=model)


def newton(fitted: Fitted, held: Any, keep: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the parameters one Newton step from a fit, some of its windows left out, (P,), within their bounds.

    Args:
        fitted: the fit to all windows.
        held: its priors, with the parameters' bounds.
        keep: which windows stay, (B,).
    """
    theta, sums = fitted.theta, fitted.statistics
    low, high = limits(fitted.model, fitted.names, held)
    free = held.inside(theta) & (theta > low) & (theta < high)
    step = np.zeros(len(theta))
    if free.any():
        hessian, slope = sums.hessian[keep].sum(0), sums.slope[keep].sum(0)
        whole = NormalEquations.with_priors(hessian, slope, held.square, theta - held.mean)
        step[free] = whole.part(free).solve()
    return np.clip(theta + step, low, high)


def within(windows: Windows, held: Log) -> NDArray[np.bool_]:
    """Return which windows share a time with what is left out, (B,)."""
    out = np.zeros(len(windows), dtype=bool)
    times = windows.times[:, windows.warmup :].numpy()
    for run in held.runs:
        own = windows.run == run.number
        out |= own & (times[:, 0] <= run.t[-1]) & (times[np.arange(len(out)), windows.length - 1] >= run.t[0])
    return out
