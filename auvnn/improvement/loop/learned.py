"""What has no name: drag of every coupling, and a force of what was measured, held close to nothing by a ridge.

How close, and which inputs, what was left out decides, linearised about the model without; then it is fitted and
judged as any other step is. Reference: Hoerl and Kennard (1970), Technometrics 12(1), for ridge regression.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.effects import Effect, effect_class
from auvnn.effects.residual_force import INPUTS, ResidualForce
from auvnn.estimation.priors import Priors, limits
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.linearised import Index, Linearised
from auvnn.improvement.loop.screen import PROMISE
from auvnn.improvement.loop.state import Recipe, State, held_by, laid_out, starting
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# How many of its scales a learned parameter may be away from nothing: what is tried.
RIDGES = (10.0, 3.0, 1.0, 0.3, 0.1, 0.03)
# Inputs of the residual force that are tried.
SUBSETS = (
    ("tilt",),
    ("velocity",),
    ("command",),
    ("tilt", "velocity"),
    ("tilt", "command"),
    ("velocity", "command"),
    ("tilt", "velocity", "command"),
    INPUTS,
)
# Of terms that promise at least this share of what the best one does, the one with the fewest weights is fitted too.
NEARLY = 0.8
KINDS = ("polynomial", "mlp", "residual_force")
EFFECT = {"polynomial": "learned_drag", "residual_force": "residual_force"}


@dataclass(frozen=True)
class Choice:
    """A learned term worth a fit.

    Attributes:
        recipe: with it.
        fall: share of the squared error on what is left out that it would take away, linearised.
        words: its inputs.
    """

    recipe: Recipe
    fall: float
    words: str


def choose(base: GreyBox, judge: Judge, state: State, kind: str) -> list[Choice]:
    """Return the learned terms of a kind that are worth a fit, at most two; none where none promises anything.

    The one that promises most, and of those that promise nearly as much the one with the fewest weights.

    Args:
        base: the model as given.
        judge: of the log.
        state: to which it is added.
        kind: "polynomial", a drag of every coupling, or "residual_force".
    """
    name = EFFECT[kind]
    if name in state.recipe.effects or name in base.effect_names:
        return []
    recipe = _with(base, state.recipe, name, None, 1.0)
    layout, names, held = laid_out(base, recipe)
    begin = starting(layout, names, held, state, probes=False)
    about = Linearised.at(layout, names, begin, judge, state)

    def left_out(columns: Index, trial: Recipe) -> float:
        return _left_out(about, layout, trial, names, columns)

    own_columns = layout.places(names)[name]
    others = np.setdiff1d(np.arange(len(begin)), own_columns)
    before = left_out(others, recipe)
    found: list[tuple[int, Choice]] = []
    for inputs in SUBSETS if kind == "residual_force" else (None,):
        mine = _columns(layout.model.effect(name), own_columns, inputs)
        if not len(mine):
            continue
        for ridge in RIDGES:
            trial = _with(base, state.recipe, name, inputs, ridge)
            fall = (before - left_out(np.sort(np.concatenate([others, mine])), trial)) / max(before, 1e-300)
            if fall > PROMISE:
                words = " and ".join(inputs) if inputs else "velocity"
                found.append((len(mine), Choice(trial, float(fall), words)))
    if not found:
        return []
    most = max(found, key=lambda c: c[1].fall)[1]
    few = min((c for c in found if c[1].fall >= NEARLY * most.fall), key=lambda c: (c[0], -c[1].fall))[1]
    return [most] if few is most else [most, few]


def _with(base: GreyBox, recipe: Recipe, name: str, inputs: Sequence[str] | None, ridge: float) -> Recipe:
    effect: Effect
    if name == "residual_force":
        effect = ResidualForce.build(base.vehicle, base.actuation, inputs=inputs)
    else:
        effect = effect_class(name).build(base.vehicle, base.actuation)
    return replace(
        recipe,
        effects=(*recipe.effects, name),
        ridge={**recipe.ridge, name: ridge},
        built={**recipe.built, name: effect},
    )


def _columns(effect: Effect, columns: Index, inputs: Sequence[str] | None) -> Index:
    """Return those columns of an effect whose parameters belong to some inputs."""
    if inputs is None:
        return columns
    wanted = []
    for p in effect.parameters_of:
        middle = p.name.partition("_")[2].rpartition("_")[0]
        wanted.append(("velocity" if len(middle) == 1 else middle.partition("_")[0]) in inputs)
    return columns[np.array(wanted)]


def _left_out(about: Linearised, layout: Layout, recipe: Recipe, names: Sequence[str], index: Index) -> float:
    """Return the squared error of all folds, each predicted by the others, some columns of the named effects free."""
    held = held_by(layout, names, recipe)
    low, high = limits(layout.model, names, held)
    fit = about.fit(names, index, Priors(held.mean[index], held.precision[index]))
    return about.left_out(fit, low[index], high[index])


def used(state: State, share: float = 0.05) -> dict[str, list[str]]:
    """Return which inputs and degrees of freedom the learned terms of a state use, by share of their weights."""
    out: dict[str, list[str]] = {}
    places = state.layout.places(state.names)
    for name in EFFECT.values():
        if name not in state.recipe.effects:
            continue
        effect, values = state.layout.model.effect(name), state.theta[places[name]]
        by: dict[str, float] = {}
        for p, value in zip(effect.parameters_of, values, strict=True):
            by[p.name[0]] = by.get(p.name[0], 0.0) + (value / p.scale) ** 2
        total = sum(by.values())
        out[name] = [axis for axis, size in by.items() if total > 0 and size / total >= share]
    return out
