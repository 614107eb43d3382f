"""A model on its way: what has been added, how it was fitted, and what it is worth on what was left out."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import ByEffect
from auvnn.damping.bank import DampingBank
from auvnn.diagnosis.cross_validation.errors import LeftOut
from auvnn.diagnosis.cross_validation.fitters import newton
from auvnn.diagnosis.hypotheses.put_into_model import holding
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out, priors, scales
from auvnn.diagnosis.one_step.fit import fit_hypothesis_one_step
from auvnn.effects import Effect
from auvnn.estimation.priors import Priors, limits, parameters_of, set_parameters
from auvnn.improvement.free_run import STEPS, FreeRunFit, fit_free_run
from auvnn.improvement.loop.judge import NEWTON, Judge
from auvnn.metrics.derivative import Derivative
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import with_commands

Array = NDArray[np.float64]
# The networks that were trained on all folds, among those trained without each.
ALL = -1
# Length of the stretches whose sums a fit one step ahead keeps apart, s.
STRETCH = 5.0


@dataclass(frozen=True)
class Recipe:
    """How a model is made from the one given and a log.

    Attributes:
        effects: names that are added, in the order in which they were accepted.
        objective: "rollout" or "one_step".
        seconds: length of the windows that are fitted; of no meaning one step ahead.
        ridge: effect to how many of its scales its parameters may be away from their nulls: what has no name is held
            closer than what has one.
        built: effects that were built in another way than by name, such as of chosen inputs.
        banks: damping subnetworks, by the fold that they have not seen, and `ALL`; none where there are no subnetworks.
    """

    effects: tuple[str, ...] = ()
    objective: str = "rollout"
    seconds: float = 5.0
    ridge: Mapping[str, float] = field(default_factory=dict)
    built: Mapping[str, Effect] = field(default_factory=dict)
    banks: Mapping[int, DampingBank] = field(default_factory=dict)

    def words(self) -> str:
        """Return the objective in words."""
        return "one step ahead" if self.objective == "one_step" else f"free running over {self.seconds:g} s"


@dataclass(frozen=True)
class State:
    """A fitted model and its errors on what was left out.

    Attributes:
        recipe: how it was made.
        layout: of its effects.
        fit: at which its parameters are known; None where nothing was fitted.
        names: effects whose parameters were free, in order of their columns.
        theta: (P,) their values.
        model: with the values in it.
        left: errors on what was left out.
    """

    recipe: Recipe
    layout: Layout
    fit: FreeRunFit | None
    names: tuple[str, ...]
    theta: Array
    model: GreyBox
    left: LeftOut


def banked(base: GreyBox, recipe: Recipe, fold: int = ALL) -> GreyBox:
    """Return a model with the subnetworks of a recipe, those that have not seen a fold; itself where there are none.

    Args:
        base: the model as given.
        recipe: with the subnetworks by fold.
        fold: number of the fold; by default those that have seen everything.
    """
    if not recipe.banks:
        return base
    made = GreyBox(base.vehicle, base.copied_effects(), copy.deepcopy(recipe.banks[fold]), base.actuation)
    return with_commands(made, base.commands)


def laid_out(base: GreyBox, recipe: Recipe) -> tuple[Layout, tuple[str, ...], Priors]:
    """Return the layout of a recipe, the effects that are free in it, and their priors."""
    base = banked(base, recipe)
    built = [e for n, e in recipe.built.items() if n not in base.effect_names]
    known = base.rebuilt([*base.copied_effects(), *built]) if built else base
    layout = lay_out(known, [n for n in recipe.effects if n not in recipe.built])
    names = tuple(dict.fromkeys([*(n for n in layout.names if n not in recipe.effects), *recipe.effects]))
    return layout, names, held_by(layout, names, recipe)


def held_by(layout: Layout, names: Sequence[str], recipe: Recipe) -> Priors:
    """Return the priors of free effects: those asked for all but free, those held by a ridge closer to nothing.

    Args:
        layout: stated values and scales.
        names: effects that are free.
        recipe: which were asked for, and which a ridge holds.
    """
    found = priors(layout, names, free=recipe.effects)
    precision = found.precision.copy()
    for name, own in layout.places(names).items():
        if name in recipe.ridge:
            precision[own] = (recipe.ridge[name] * scales(layout, name)) ** -2.0
    # What was fitted before counts alone here: the loop takes some of the columns at a time.
    return replace(found, precision=precision, joint=None)


def starting(layout: Layout, names: Sequence[str], held: Priors, before: State | None, probes: bool) -> Array:
    """Return where to begin a fit, (P,): where the state before is, what is new at its null or its probe.

    Args:
        layout: stated values.
        names: effects that are free, P parameters in all.
        held: their priors.
        before: the state whose values are taken, or None.
        probes: begin what is new at its first probe, because it may have no slope at its null.
    """
    model = layout.model.rebuilt(layout.model.copied_effects())
    known = {} if before is None else before.layout.places(before.names)
    for name in names:
        effect = model.effect(name)
        if before is not None and name in known:
            set_parameters(model, [name], before.theta[known[name]])
        elif probes:
            # At the null itself an effect may have no slope; its own probe is where to begin.
            values = [
                p.probes[0] if p.probes and v == p.null else v
                for p, v in zip(effect.parameters_of, effect.values().values(), strict=True)
            ]
            set_parameters(model, [name], np.array(values))
    return np.clip(parameters_of(model, names), *limits(model, names, held))


def fitted(
    base: GreyBox,
    judge: Judge,
    recipe: Recipe,
    before: State | None = None,
    *,
    start: Array | None = None,
    steps: int = STEPS,
) -> State:
    """Fit a recipe by free running and judge it on what was left out.

    Args:
        base: the model as given.
        judge: of the log.
        recipe: what to make.
        before: a state whose values to begin from.
        start: (P,) values to begin from instead.
        steps: of the fit, at most.
    """
    layout, names, held = laid_out(base, recipe)
    task, _, _ = judge.task(recipe.seconds)
    begin = starting(layout, names, held, before, probes=True) if start is None else start
    fit = fit_free_run(layout.model, task, names, held, start=begin, steps=steps)
    model = holding(banked(base, recipe), layout, names, fit.theta, recipe.effects)
    left = judge.left_out(fold_models(base, judge, recipe, layout, fit), recipe.effects, NEWTON)
    return State(recipe, layout, fit, names, fit.theta, model, left)


def fold_models(
    base: GreyBox, judge: Judge, recipe: Recipe, layout: Layout, fit: FreeRunFit
) -> dict[int, GreyBox]:
    """Return the model of a recipe for each fold, fitted without it: one Newton step from the fit to everything.

    Args:
        base: the model as given.
        judge: of the log, with its folds.
        recipe: what is fitted.
        layout: of the recipe's parameters.
        fit: to the whole log.
    """
    _, _, free = judge.task(recipe.seconds)
    models = {}
    for k, fold in enumerate(judge.folds.numbers):
        theta = fit.newton(layout.model, free[:, k]) if free[:, k].any() and len(fit.theta) else fit.theta
        models[fold] = holding(banked(base, recipe, fold), layout, fit.names, theta, recipe.effects)
    return models


def fitted_one_step(
    base: GreyBox, judge: Judge, recipe: Recipe, how: Derivative, before: State | None = None
) -> State:
    """Fit a recipe one step ahead and judge it by free running on what was left out; see `fitted`.

    Args:
        base: the model as given.
        judge: of the log.
        recipe: what is fitted.
        how: how accelerations are obtained.
        before: not used: the fit begins at the stated values.
    """
    layout, names, _ = laid_out(base, recipe)
    log = replace(judge.log, runs=tuple(run.cleaned for run in judge.log.runs))
    free = [n for n in names if n not in recipe.effects]
    found = fit_hypothesis_one_step(layout, log, free, recipe.effects, how)
    sums, starts = found.fitted.statistics, {run.number: run.t for run in judge.log.runs}
    begin = np.array([starts[int(r)][f] for r, f in zip(sums.run, sums.first, strict=True)])
    _, apart = judge.folds.stretches(sums.run, begin, begin + STRETCH)
    models = {}
    order = found.names
    for k, fold in enumerate(judge.folds.numbers):
        theta = (
            newton(found.fitted, found.fitted.priors, apart[:, k])
            if apart[:, k].any()
            else found.fitted.theta
        )
        models[fold] = holding(base, layout, order, theta, recipe.effects)
    left = judge.left_out(models, recipe.effects, NEWTON)
    model = holding(base, layout, order, found.fitted.theta, recipe.effects)
    return State(recipe, layout, None, order, found.fitted.theta, model, left)


def as_given(base: GreyBox, judge: Judge) -> State:
    """Return the model as given: nothing is fitted."""
    layout = lay_out(base, ())
    return State(Recipe(), layout, None, (), np.zeros(0), base, judge.as_it_is(base))


def parameters(state: State) -> ByEffect:
    """Return the values of the effects that were added, with standard errors: sandwich estimates over windows.

    Reference: White (1982), Econometrica 50(1).
    """
    fit, out = state.fit, {}
    places = state.layout.places(state.names)
    std = np.full(len(state.theta), np.nan)
    if fit is not None and len(fit.theta):
        bread = np.linalg.pinv(
            fit.hessian.sum(0) + fit.weight * np.diag(fit.priors.precision), hermitian=True
        )
        meat = fit.slope.T @ fit.slope
        # Windows overlap by half: each error is counted about twice.
        std = np.sqrt(np.maximum(2.0 * np.diag(bread @ meat @ bread), 0.0))
    for name in state.recipe.effects:
        if name in state.recipe.ridge:
            continue
        described = state.layout.model.effect(name).parameters_of
        out[name] = {
            p.name: {"value": float(state.theta[i]), "std": float(std[i]), "unit": p.unit}
            for p, i in zip(described, places[name], strict=True)
        }
    return out
