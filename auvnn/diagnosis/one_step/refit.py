"""One effect beside everything else that is uncertain, fitted to accelerations and judged on fifths left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import FREE, Layout, lay_out, priors, scales
from auvnn.diagnosis.one_step.slopes import AccelerationSlopes, extent_of_log
from auvnn.diagnosis.one_step.weighted_fit import Linear, left_out, parts, solve, weights
from auvnn.effects import effect_class
from auvnn.errors import InputError
from auvnn.estimation.nuisance_elimination import carry_of
from auvnn.estimation.priors import Priors, limits, parameters_of, set_parameters
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative
from auvnn.models import GreyBox

Array = NDArray[np.float64]

# Linearisations of one fit at most; it has settled when the cost falls by less than this share.
LINEARISED, SETTLED = 6, 1e-4
# A step that makes things worse is halved so often before it is given up.
HALVED = 5
# Share of the samples that an effect must influence, at least.
SAID = 0.5


@dataclass(frozen=True)
class RefittedEffect:
    """Where a fit with an effect has come to.

    Attributes:
        theta: parameters of everything else, then of the effect, (P,).
        after: (N,) weighted squared error of each sample when its fifth is left out; NaN where there is none, or nobody
            asked for it.
        values: the effect's parameters by name.
        fell: by how much the weighted squared error of what is fitted, and the departure from what was stated, fall.
    """

    theta: Array
    after: Array
    values: dict[str, float]
    fell: float = 0.0


@dataclass(frozen=True)
class _Fit:
    """Parameters, the gap that they leave (N, 6), and the slopes there (N, 6, P)."""

    theta: Array
    gap: Array
    slopes: Array


class OneStepRefit:
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
        self.held = self._priors(layout, self.base)
        world = AccelerationSlopes(layout.model, log, how)
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
        # Sums that every candidate needs: its own share is what these leave of it.
        flat = self.fit.slopes[self.good].reshape(int(6 * self.good.sum()), len(self.fit.theta))
        self.heavy = flat * self.weight[self.good].reshape(-1, 1)
        away = self.held.mean - self.fit.theta
        self.square = self.heavy.T @ flat + np.diag(self.held.precision)
        self.right = self.heavy.T @ self.fit.gap[self.good].ravel() + self.held.precision * away

    def alone(self, name: str, *, judged: bool = True) -> RefittedEffect | None:
        """Fit an effect with the slopes of everything else as they were; None where the log says nothing of it.

        Of the values that the effect offers for its shape, the one is taken that promises most.

        Args:
            name: the effect.
            judged: whether errors on fifths left out are worked out.
        """
        layout, names, held = self._with(name)
        world = AccelerationSlopes(layout.model, self.log, self.how)
        theta = parameters_of(world.model, names)
        first = len(parameters_of(world.model, names[: names.index(name)]))
        own = np.arange(first, first + len(layout.columns[name]))
        described = layout.described(name)
        starts = effect_class(name).starts(described, self.extent)
        if len(starts) > 1:
            tried = [[s.get(p.name, p.null) for p in described] for s in starts]
            theta[own] = max(tried, key=lambda start: self._promise(world, name, np.array(start)))
            set_parameters(world.model, [name], theta[own])
        others = np.setdiff1d(np.arange(len(theta)), own)
        low, high = limits(world.model, names, held)
        free = ~_shapes(world.model, names)
        gap, begin = world.gap(), theta
        slopes = np.zeros((*gap.shape, len(theta)))
        slopes[..., : self.fit.slopes.shape[-1]] = self.fit.slopes

        def left_at(there: Array, at: Array) -> Array:
            """Return the gap at some values; everything else follows along slopes that stay as they were."""
            return there - slopes[..., others] @ (at - begin)[others]

        left, point, fell = left_at(gap, theta), None, 0.0
        for _ in range(LINEARISED):
            slopes[..., own] = world.slopes([name], gap)
            rows = self.good & np.isfinite(left).all(1) & np.isfinite(slopes[..., own]).all((1, 2))
            if rows.sum() < SAID * self.good.sum() or not np.abs(slopes[rows][..., own]).max() > 0.0:
                break
            x, mean, precision = slopes[rows][..., free], (held.mean - theta)[free], held.precision[free]
            linear = Linear(rows, left[rows], x, precision, mean)
            step = np.zeros(len(theta))
            step[free] = solve(left[rows], x, precision, self.weight[rows], mean)
            now = self._cost(left, rows, theta, held)
            for half in range(HALVED):
                trial = np.clip(theta + 0.5**half * step, low, high)
                gap = world.at([name], trial[own])
                reached = left_at(gap, trial)
                then = self._cost(reached, rows, trial, held)
                if then <= now:
                    break
            else:
                world.at([name], theta[own])
                point = point or (theta, 0.0, linear)
                break
            theta, left, fell = trial, reached, fell + now - then
            point = theta, fell, linear
            if now - then < SETTLED * then:
                break
        if point is None:
            return None
        theta, fell, linear = point
        after = linear.after(self.weight, self.fifth) if judged else np.full(len(gap), np.nan)
        return RefittedEffect(theta, after, _values(world.model, name, theta[own]), fell)

    def _cost(self, left: Array, rows: NDArray[np.bool_], theta: Array, held: Priors) -> float:
        """Return the weighted squared error of some samples and the departure from what was stated."""
        value = (self.weight[rows] * left[rows] ** 2).sum() + held.precision @ (theta - held.mean) ** 2
        return float(value) if np.isfinite(value) else float("inf")

    def _promise(self, world: AccelerationSlopes, name: str, start: Array) -> float:
        """Return by how much the cost falls with an effect of a given shape, as its slopes at the null have it."""
        set_parameters(world.model, [name], start)
        # Whatever its shape, at the null it does nothing: the gap is that of the fit without it.
        own = world.slopes([name], self.fit.gap)[self.good]
        live = ~_shapes(world.model, [name])
        own = own[..., live].reshape(-1, int(live.sum()))
        if not np.isfinite(own).all() or not own.size:
            return -np.inf
        described = world.model.effect(name).parameters_of
        loose = (FREE * np.array([p.scale for p in described])[live]) ** -2.0
        across = self.heavy.T @ own
        carry = carry_of(self.square, across, rcond=1e-13)
        weighted = own * self.weight[self.good].reshape(-1, 1)
        right = weighted.T @ self.fit.gap[self.good].ravel() - carry @ self.right
        square = weighted.T @ own - carry @ across + np.diag(loose)
        return float(right @ np.linalg.lstsq(square, right, rcond=1e-13)[0])

    def jointly(self, name: str, start: RefittedEffect) -> RefittedEffect:
        """Fit an effect together with everything else, from where it was fitted alone."""
        layout, names, held = self._with(name)
        world = AccelerationSlopes(layout.model, self.log, self.how)
        rows = self.good & np.isfinite(start.after)
        fit = self._settled(world, names, start.theta, held, rows)
        after = self._after(fit, names, held, rows, layout.model)
        return RefittedEffect(
            fit.theta, after, _values(layout.model, name, parameters_of(world.model, [name]))
        )

    def _with(self, name: str) -> tuple[Layout, list[str], Priors]:
        """Return the layout with a candidate, at the refitted values, the effects that are free, and their priors."""
        layout = lay_out(self.model, [name])
        set_parameters(layout.model, self.base, self.fit.theta)
        names = [*self.base, *([] if name in self.base else [name])]
        return layout, names, self._priors(layout, names, name)

    def _priors(self, layout: Layout, names: Sequence[str], asked: str = "") -> Priors:
        """Return priors: stated uncertainties; of effects that the model has, what is plausible about what they are.

        An effect that the model has was fitted or stated: were it free, a log in which only a part knows of it would say
        more about that part than about the candidates once the part is left out.
        """
        held = priors(layout, names, free=[asked])
        precision = held.precision.copy()
        for name, own in layout.places(names).items():
            if name in self.model.effect_names and name not in layout.spreads and name != asked:
                precision[own] = scales(layout, name) ** -2.0
        return Priors(held.mean, precision, held.reach)

    def _settled(
        self,
        world: AccelerationSlopes,
        names: Sequence[str],
        theta: Array,
        held: Priors,
        rows: NDArray[np.bool_],
    ) -> _Fit:
        """Fit by Gauss and Newton's method from a start, slopes computed again at every step."""
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
