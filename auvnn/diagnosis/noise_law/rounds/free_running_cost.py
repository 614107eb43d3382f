"""What a name costs in free running, and which explanations cost enough to be named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.selection.model_comparison import ODDS, confused
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import limits, set_parameters
from auvnn.logs import Log
from auvnn.metrics.rollouts import Rolled, Scale, roll
from auvnn.metrics.windows import VELOCITY
from auvnn.models import GreyBox

Array = NDArray[np.float64]
HORIZON = "5"
# Standard errors by which free running must be worse before that counts against a name.
SURE = 2.0


@dataclass(frozen=True)
class Cost:
    """What a name costs in free running over 5 s.

    Attributes:
        error: by what share the root-mean-square error is larger without the name than with it.
        typical: by what share that of the median window is. Where outliers of the sensors put windows on a wrong start,
            or the vehicle nearly loses its way, a few windows decide the error of all.
        moves: what the error would be if what is missing were independent of the commands: sqrt(1 + d^2) - 1, with d the
            change of the predictions over the error that is left. Under a controller the commands answer the force, so
            that the error of free running is least at wrong values, and a right name may make it larger.
        moves_typically: the same of the median window.
        worse: whether errors are surely larger with the name, by the paired differences of the windows.
    """

    error: float
    typical: float
    moves: float
    moves_typically: float
    worse: bool

    @property
    def least(self) -> float:
        """What the name costs at least in all windows, or in the median one."""
        return max(self.error, self.typical)


def cost_of_name(
    layout: Layout,
    after: Hypothesis,
    before: Hypothesis,
    log: Log,
    scale: Scale,
    *,
    others_stay: bool = False,
) -> Cost:
    """Return what a name costs in free running, see `free_running_cost`, everything else refitted.

    Where the effect is a coefficient group that is uncertain anyway, the hypothesis without the name has taken up a part
    of it: there that group stays as it was stated, and the other parameters follow it by one Newton step under the law,
    or stay as they are with the name, whichever predicts better.

    Args:
        layout: stated values.
        after: hypothesis with a name more.
        before: hypothesis without it.
        log: on which both run freely.
        scale: of the errors, as `rollouts.scale_of` has it.
        others_stay: whether what the name does with everything else as it is with it counts, where that is more: what is
            uncertain anyway may take up most of it.
    """
    with_name = model_of(after)
    if after.name in before.explanation.names:
        costs = [
            free_running_cost(with_name, model, log, scale) for model in as_stated(layout, after.weighed)
        ]
        return min(costs, key=lambda cost: cost.error)
    cost = free_running_cost(with_name, model_of(before), log, scale)
    if not others_stay:
        return cost
    alone = free_running_cost(with_name, _without(after), log, scale)
    return max(cost, alone, key=lambda cost: cost.error)


def _without(found: Hypothesis) -> GreyBox:
    """Return the model that a hypothesis says, its last effect aside."""
    fitted = found.explanation.fitted
    model = fitted.model.rebuilt(fitted.model.copied_effects())
    set_parameters(model, [found.name], np.array([p.null for p in model.effect(found.name).parameters_of]))
    return model.without_absent(found.explanation.effects[:-1])


def model_of(found: Hypothesis) -> GreyBox:
    """Return the model that a hypothesis says.

    Args:
        found: the hypothesis.
    """
    return found.explanation.fitted.model.without_absent(found.explanation.effects)


def as_stated(
    layout: Layout, found: FittedHypothesis, held: Sequence[str] | None = None
) -> tuple[GreyBox, GreyBox]:
    """Return the model with what some effects vary as stated, the others refitted, and left where they are.

    Args:
        layout: stated values.
        found: the fit, with sums by which the others follow.
        held: effects of the fit that are as stated; the last one by default.
    """
    fitted, names = found.fitted, found.names
    held = [found.effects[-1]] if held is None else list(held)
    places, none = layout.places(names), np.zeros(0, dtype=np.int64)
    own = np.concatenate([none, *(places[n] for n in held)])
    others = np.setdiff1d(np.arange(len(fitted.theta)), own)
    stated = fitted.theta.copy()
    stated[own] = np.concatenate([np.zeros(0), *(layout.means[n] for n in held)])
    whole = NormalEquations(fitted.statistics.total + fitted.priors.square, np.zeros(len(stated)))
    followed = stated.copy()
    followed[others] -= whole.eliminate(own, others, rcond=1e-12).carry.T @ (stated - fitted.theta)[own]
    low, high = limits(fitted.model, names, fitted.priors)
    models = []
    for values in (np.clip(followed, low, high), stated):
        model = fitted.model.rebuilt(fitted.model.copied_effects())
        set_parameters(model, names, values)
        models.append(model.without_absent(found.effects))
    return models[0], models[1]


def free_running_cost(after: GreyBox, before: GreyBox, log: Log, scale: Scale) -> Cost:
    """Return what an effect costs in free running over 5 s.

    Args:
        after: the model with the effect.
        before: the model without it.
        log: on which both run freely.
        scale: of the errors, as `rollouts.scale_of` has it.
    """
    # Machine code that repeats to the bit: the same explanation must cost the same each time.
    first, last = (roll(model, log, HORIZON, scale, engine="firm") for model in (before, after))
    if first is None or last is None:
        return Cost(float("inf"), float("inf"), float("inf"), float("inf"), False)
    errors, typical = (
        [of(r) for r in (first, last)] for of in (lambda r: r.total(scale), partial(_median, scale))
    )
    change = replace(last, squared=_moved(first.predicted, last))
    moves = _moves(change.total(scale), errors[1])
    moves_typically = _moves(_median(scale, change), typical[1])
    worse = _surely_less(*(_by_window(scale, r) for r in (first, last)))
    return Cost(_share(*errors), _share(*typical), moves, moves_typically, worse)


def _moves(change: float, error: float) -> float:
    """Return what the error would be, above what it is, if what predictions change by were independent of it."""
    away = change / error if error > 0.0 else float("inf")
    return float(np.sqrt(1.0 + away**2) - 1.0) if np.isfinite(away) else 0.0


def _share(without: float, whole: float) -> float:
    """Return by what share an error is larger than another one."""
    return without / whole - 1.0 if np.isfinite(whole) and whole > 0.0 else -1.0


def _by_window(scale: Scale, rolled: Rolled) -> Array:
    """Return the mean square of each window's errors in the excited velocities, over their variance, (B, k).

    NaN where a window has no sample of a velocity.
    """
    square = rolled.squared / np.where(rolled.count > 0.0, rolled.count, np.nan) / scale.std**2
    return square[:, scale.excited & (rolled.count.sum(0) > 0)]


def _median(scale: Scale, rolled: Rolled) -> float:
    """Return the mean over velocities of the root of the median window's square."""
    return float(np.sqrt(np.nanmedian(_by_window(scale, rolled), axis=0)).mean())


def _surely_less(first: Array, last: Array) -> bool:
    """Whether squares (B, k) are less than others by so many standard errors of the mean of their differences."""
    gain = np.nansum(first - last, axis=1)
    return len(gain) > 1 and bool(gain.sum() < -SURE * np.sqrt(len(gain)) * gain.std(ddof=1))


def _moved(before: Array, last: Rolled) -> Array:
    """Return the sum of squared changes of what was predicted, (B, 6), zero where a window diverged."""
    mask = last.windows.mask[..., VELOCITY].numpy().copy()
    mask[:, 0] = 0.0
    return (np.nan_to_num(last.predicted - before) ** 2 * mask).sum(1)


def paying(
    likely: Sequence[Hypothesis], costs: Sequence[float], enough: float, worse: Sequence[bool]
) -> list[Hypothesis]:
    """Return those explanations that cost enough, and those that the data prefer to the likeliest of them.

    A less likely one must not be named because a likelier one that makes free running better costs little: then
    that one comes first, and the other is asked for again beside it. Effects that the catalogue knows to be confused
    with the name are compared with it, too. In open loop none is given where a likelier one makes free running
    worse: what the data prefer and what free running contradicts says that neither can be trusted. In closed loop
    a right name may make it worse, and how far it moves the predictions counts.

    Args:
        likely: explanations, the most evident first.
        costs: of each of them.
        enough: the cost that is enough.
        worse: whether each makes free running worse by more than does not matter.
    """
    paid = [k for k, cost in enumerate(costs) if cost > enough]
    if not paid:
        return []
    first = paid[0]
    if any(w and h.evidence > likely[first].evidence + ODDS for h, w in zip(likely, worse, strict=True)):
        return []
    good = [k for k in range(len(likely)) if k in paid or (k < first and costs[k] > 0.0)]
    best = likely[good[0]].name
    return [h for k, h in enumerate(likely) if k in good or (k > first and confused(h.name, best))]
