"""Which effects are worth a fit: all of the catalogue at once, linearised, by what they predict of what is left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out, shapes
from auvnn.diagnosis.score_tests.probes import null_is_no_start
from auvnn.estimation.priors import limits
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.linearised import Index, Linearised
from auvnn.improvement.loop.state import Recipe, State, held_by, laid_out, starting
from auvnn.models import GreyBox
from auvnn.progress import Progress

Array = NDArray[np.float64]
# Effects that go by the time since the start of a run.
COURSES = ("payload", "flooding", "biofouling", "waves")
# Share of the error by which a candidate must promise to lower it, to be fitted at all.
PROMISE = 0.005


@dataclass(frozen=True)
class Promise:
    """What an effect promises, before it is fitted.

    Attributes:
        effect: name.
        fall: share of the squared error on what is left out that it would take away, linearised.
        start: (P,) parameters from which to begin its fit.
    """

    effect: str
    fall: float
    start: Array


def wanted(base: GreyBox, judge: Judge, recipe: Recipe) -> list[str]:
    """Return the effects that may be asked for: those of the catalogue that can be judged with the log and the vehicle.

    One that the model has is asked for with other values than it states.

    What goes by the time since the start of a run tells a course of events. Where the diagnosis does not name it,
    there is no reason why another run should follow the same course: it is not taken for its prediction alone.

    Args:
        base: the model as given.
        judge: with the log.
        recipe: what has been added already.
    """
    usable, _ = candidates_for(base, judge.log, None, stated=True)
    return [n for n in usable if n not in recipe.effects and n not in COURSES]


def promises(
    base: GreyBox,
    judge: Judge,
    state: State,
    names: Sequence[str],
    say: Callable[[str], None],
) -> list[Promise]:
    """Return what each of several effects promises in addition to a state, best first.

    Each is linearised where its fit would begin, everything else free with it; a fold is predicted by the others.

    Args:
        base: the model as given.
        judge: folds and windows of the log.
        state: to which the effects would be added.
        names: of the effects.
        say: called with what is being done, in words.
    """
    plain, shaped = [], []
    whole = lay_out(base, [*(n for n in state.recipe.effects if n not in state.recipe.built), *names])
    for name in names:
        stateds = name in state.layout.nuisance
        (shaped if not stateds and null_is_no_start(whole, name) else plain).append(name)
    found: list[Promise] = []
    groups = [plain, *([n] for n in shaped)] if plain else [[n] for n in shaped]
    for k, group in enumerate(groups):
        what = group[0] if len(group) == 1 else f"{len(group)} effects"
        say(Progress(f"looking at {what}", k, len(groups)))
        try:
            found += _group(base, judge, state, group)
        except (FloatingPointError, np.linalg.LinAlgError, RuntimeError, ValueError):
            continue  # what cannot even be linearised is not fitted
    return sorted((p for p in found if p.fall > 0), key=lambda p: -p.fall)


def _group(base: GreyBox, judge: Judge, state: State, group: Sequence[str]) -> list[Promise]:
    recipe = replace(state.recipe, effects=(*state.recipe.effects, *group))
    layout, names, held = laid_out(base, recipe)
    begin = starting(layout, names, held, state, probes=len(group) == 1)
    about = Linearised.at(layout, names, begin, judge, state)
    places = layout.places(names)
    without = [n for n in names if n not in group or n in layout.nuisance]
    before = _left_out(about, layout, state.recipe, without, places)[0]
    found = []
    for name in group:
        columns = [*without, *([] if name in without else [name])]
        own_recipe = replace(state.recipe, effects=(*state.recipe.effects, name))
        after, theta = _left_out(about, layout, own_recipe, columns, places)
        # The fit of this effect alone has its own columns, in its own order.
        alone, order, alone_held = laid_out(base, own_recipe)
        start = starting(alone, order, alone_held, state, probes=True)
        at = alone.places(order)
        if not shapes(layout, name).any():
            start[at[name]] = theta[layout.places(columns)[name]]
        reference = about.cost.sum() if len(group) == 1 else before
        found.append(Promise(name, float((reference - after) / max(before, 1e-300)), start))
    return found


def _left_out(
    about: Linearised, layout: Layout, recipe: Recipe, names: Sequence[str], places: Mapping[str, Index]
) -> tuple[float, Array]:
    """Return the squared error of all folds, each predicted by the others, and the fit to all."""
    index = np.concatenate([places[n] for n in names]) if names else np.zeros(0, dtype=int)
    held = held_by(layout, names, recipe)
    fit = about.fit(names, index, held)
    return about.left_out(fit, *limits(layout.model, names, held)), fit.newton(layout.model, slice(None))
