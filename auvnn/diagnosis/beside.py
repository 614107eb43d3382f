"""One effect beside everything else that is uncertain, fitted to accelerations and judged on fifths left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.nuisance import Layout, lay_out, priors
from auvnn.diagnosis.one_step_slopes import Replayed, extent_of_log
from auvnn.diagnosis.weighted_fit import left_out, parts, solve, weights
from auvnn.effects import effect_class
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.metrics.one_step import Derivative
from auvnn.models import GreyBox
from auvnn.training.prediction_error import Priors, limits, parameters_of, set_parameters

Array = NDArray[np.float64]

# Linearisations of one fit at most; it has settled when the cost falls by less than this share.
LINEARISED, SETTLED = 6, 1e-4
# A step that makes things worse is halved so often before it is given up.
HALVED = 5
# Share of the samples that an effect must have a say of, at least.
SAID = 0.5


@dataclass(frozen=True)
class Point:
    """Where a fit with an effect has come to.

    Attributes:
        theta: parameters of everything else, then of the effect, (P,).
        after: (N,) weighted squared error of each sample when its fifth is left out; NaN where there is none.
        values: the effect's parameters by name.
    """

    theta: Array
    after: Array
    values: dict[str, float]


@dataclass(frozen=True)
class _Fit:
    """Parameters, the gap that they leave (N, 6), and the slopes there (N, 6, P)."""

    theta: Array
    gap: Array
    slopes: Array


class Beside:
    """A model refitted one step ahead without any candidate, and what each candidate makes of it.

    Args:
        model: as known.
        log: measurements.
        how: how accelerations are obtained.

    Attributes:
        before: (N,) weighted squared error of each sample when its fifth is left out; NaN where there is none.
        block: (N,) which samples count as one when an uncertainty is judged.

    Raises:
        InputError: no sample has a state, a command and an acceleration.
    """

    def __init__(self, model: GreyBox, log: Log, how: Derivative) -> None:
        """Refit what is uncertain."""
        self.model, self.log, self.how = model, log, how
        self.extent = extent_of_log(log)
        layout = lay_out(model, ())
        self.base = list(layout.names)
        self.held = priors(layout, self.base)
        world = Replayed(layout.model, log, how)
        theta = parameters_of(layout.model, self.base)
        gap = world.gap()
        self.good = np.asarray(np.isfinite(gap).all(1))
        if not self.good.any():
            raise InputError(
                f"{log.name} has no sample with state, command and acceleration: nothing to rank by"
            )
        self.block, self.fifth = parts(log)
        self.weight = np.zeros_like(gap)
        self._weigh(gap, world.slopes(self.base, gap), theta, self.held)
        self.fit = self._settled(world, self.base, theta, self.held, self.good)
        # The weights follow the errors that are left where the fit has come to.
        self._weigh(self.fit.gap, self.fit.slopes, self.fit.theta, self.held)
        self.fit = self._settled(world, self.base, self.fit.theta, self.held, self.good)
        self.before = self._after(self.fit, self.base, self.held, self.good, layout.model)
        set_parameters(layout.model, self.base, self.fit.theta)
        self.refitted = layout.model

    def alone(self, name: str) -> Point | None:
        """Fit an effect with the slopes of everything else as they were; None where the log says nothing of it.

        Of the values that the effect offers for its shape, the one is taken that fits best.
        """
        kind = effect_class(name)
        described = kind.describe(self.model.vehicle, self.model.actuation)
        starts = [[s.get(p.name, p.null) for p in described] for s in kind.starts(described, self.extent)]
        if len(starts) > 1:
            starts = sorted(starts, key=lambda start: self._alone(name, start, 1)[0])
        return self._alone(name, starts[0], LINEARISED)[1]

    def jointly(self, name: str, start: Point) -> Point:
        """Fit an effect together with everything else, from where it was fitted alone."""
        layout, names, held = self._with(name)
        world = Replayed(layout.model, self.log, self.how)
        rows = self.good & np.isfinite(start.after)
        fit = self._settled(world, names, start.theta, held, rows)
        after = self._after(fit, names, held, rows, layout.model)
        return Point(fit.theta, after, _values(layout.model, name, parameters_of(world.model, [name])))

    def _with(self, name: str) -> tuple[Layout, list[str], Priors]:
        """Return the layout with a candidate, at the refitted values, the effects that are free, and their priors."""
        layout = lay_out(self.model, [name])
        set_parameters(layout.model, self.base, self.fit.theta)
        names = [*self.base, *([] if name in self.base else [name])]
        return layout, names, priors(layout, names, free=[name])

    def _alone(self, name: str, start: Sequence[float], rounds: int) -> tuple[float, Point | None]:
        """Return the cost and where the fit has come to after so many linearisations of the effect itself."""
        layout, names, held = self._with(name)
        theta = parameters_of(layout.model, names)
        known = name in self.base
        size = len(layout.columns[name])
        first = len(parameters_of(layout.model, names[: names.index(name)]))
        own = np.arange(first, first + size)
        if not known:
            theta[own] = start
            set_parameters(layout.model, names, theta)
        others = np.setdiff1d(np.arange(len(theta)), own)
        world = Replayed(layout.model, self.log, self.how)
        low, high = limits(layout.model, names, held)
        free = ~_shapes(layout.model, names)
        gap, begin = world.gap(), theta
        slopes = np.zeros((*gap.shape, len(theta)))
        slopes[..., : self.fit.slopes.shape[-1]] = self.fit.slopes
        cost, point = np.inf, None
        for _ in range(rounds):
            slopes[..., own] = world.slopes([name], gap)
            # Everything else follows along slopes that stay as they were.
            left = gap - slopes[..., others] @ (theta - begin)[others]
            rows = self.good & np.isfinite(left).all(1) & np.isfinite(slopes[..., own]).all((1, 2))
            if rows.sum() < SAID * self.good.sum() or not np.abs(slopes[rows][..., own]).max() > 0.0:
                break
            x, mean, precision = slopes[rows][..., free], (held.mean - theta)[free], held.precision[free]
            step = np.zeros(len(theta))
            step[free] = solve(left[rows], x, precision, self.weight[rows], mean)
            error = left[rows] - x @ step[free]
            now = float(
                (self.weight[rows] * error**2).sum() + held.precision @ (theta + step - held.mean) ** 2
            )
            after = np.full(len(gap), np.nan)
            after[rows] = left_out(left[rows], x, precision, mean, self.weight[rows], self.fifth[rows])
            theta = np.clip(theta + step, low, high)
            fell, cost = cost - now, now
            point = Point(theta, after, _values(layout.model, name, theta[own]))
            if fell < SETTLED * now:
                break
            gap = world.at([name], theta[own])
        return cost, point

    def _settled(
        self, world: Replayed, names: Sequence[str], theta: Array, held: Priors, rows: NDArray[np.bool_]
    ) -> _Fit:
        """Fit by Gauss and Newton's method from a start, slopes taken anew at every step."""
        low, high = limits(world.model, names, held)
        free = ~_shapes(world.model, names)

        def cost(gap: Array, at: Array) -> float:
            if not np.isfinite(gap[rows]).all():
                return np.inf
            return float((self.weight[rows] * gap[rows] ** 2).sum() + held.precision @ (at - held.mean) ** 2)

        theta = np.clip(theta, low, high)
        gap = world.at(names, theta)
        slopes, now = world.slopes(names, gap), cost(gap, theta)
        for _ in range(LINEARISED):
            step = np.zeros(len(theta))
            x, mean = slopes[rows][..., free], (held.mean - theta)[free]
            step[free] = solve(gap[rows], x, held.precision[free], self.weight[rows], mean)
            for half in range(HALVED):
                trial = np.clip(theta + 0.5**half * step, low, high)
                there = world.at(names, trial)
                then = cost(there, trial)
                if then <= now:
                    break
            else:
                world.at(names, theta)
                break
            fell, theta, gap, now = now - then, trial, there, then
            slopes = world.slopes(names, gap)
            if fell < SETTLED * now:
                break
        return _Fit(theta, gap, slopes)

    def _after(
        self, fit: _Fit, names: Sequence[str], held: Priors, rows: NDArray[np.bool_], model: GreyBox
    ) -> Array:
        """Return each sample's weighted squared error when its fifth is left out, (N,), linear about a fit."""
        free = ~_shapes(model, names) & held.inside(fit.theta)
        out = np.full(len(rows), np.nan)
        rows = rows & np.isfinite(fit.gap).all(1) & np.isfinite(fit.slopes).all((1, 2))
        out[rows] = left_out(
            fit.gap[rows], fit.slopes[rows][..., free], held.precision[free], (held.mean - fit.theta)[free],
            self.weight[rows], self.fifth[rows],
        )  # fmt: skip
        return out

    def _weigh(self, gap: Array, slopes: Array, theta: Array, held: Priors) -> None:
        self.good = rows = np.asarray(self.good & np.isfinite(gap).all(1) & np.isfinite(slopes).all((1, 2)))
        self.weight = np.zeros_like(gap)
        self.weight[rows] = weights(gap[rows], slopes[rows], held.precision, held.mean - theta)


def _shapes(model: GreyBox, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return which of the effects' parameters say how they act and not how much, (P,)."""
    return np.array([p.shape for n in names for p in model.effect(n).parameters_of], dtype=bool)


def _values(model: GreyBox, name: str, theta: Array) -> dict[str, float]:
    return {p.name: float(v) for p, v in zip(model.effect(name).parameters_of, theta, strict=True)}
