"""Which of the names of a search are told, and in which order: by what each costs the predictions beside the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.answers.effect_costs import Cost, costs_in_one
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.cross_validation.errors import Gain
from auvnn.effects.acting_beside import needed_beside

# Standard errors of the difference by which one name costs more than another.
SURELY = 2.0
# Verdicts of steps that give a name.
NAMING = ("named", "ambiguous")


def costliest_first(steps: Sequence[SearchStep], costs: Mapping[str, Cost]) -> list[SearchStep]:
    """Return the steps of a search, a name ahead of those found before it that surely cost less.

    What is found first brings most while the others are missing still: with many samples that may be a small fault of
    the model that the whole log shows, and what the predictions suffer from comes after it. Names whose costs do not
    differ by two standard errors stay in the order of the search, and so does every step that gives no name.

    Args:
        steps: what was found one after the other.
        costs: of the names of the fit; a group of names has that of the one that stands for it.
    """
    gains = [next((costs[n].gain for n in s["effects"] if n in costs), None) for s in steps]
    named = [k for k, s in enumerate(steps) if s["verdict"] in NAMING and gains[k] is not None]
    order: list[int] = []
    for k in named:
        at = len(order)
        while at and _surely_costlier(gains[k], gains[order[at - 1]]):
            at -= 1
        order.insert(at, k)
    out = list(steps)
    for place, k in zip(named, order, strict=True):
        out[place] = steps[k]
    return out


def known_to_pay(
    steps: Sequence[SearchStep], costs: Mapping[str, Cost], tolerance: Tolerance
) -> tuple[list[SearchStep], list[str]]:
    """Return the steps without further names that are not known to improve predictions, and those names.

    A name after the first one must let the error on what is left out fall by more than the standard error of that
    fall, in total, or surely and by the tolerance in one velocity: `add` would not accept it either. Where the
    tolerance is zero, and of names whose cost is unknown, nothing is asked. What a name that stays needs beside it
    stays with it.

    Args:
        steps: in the order in which they are told.
        costs: of the names of the fit; a group of names has that of the one that stands for it.
        tolerance: what does not matter.
    """
    naming = [s for s in steps if s["verdict"] in NAMING]
    if tolerance.strict or len(naming) < 2:
        return list(steps), []
    gains = [next((costs[n].gain for n in s["effects"] if n in costs), None) for s in naming]
    stays = [not k or g is None or _pays(g, tolerance) for k, g in enumerate(gains)]
    told = {n for s, stay in zip(naming, stays, strict=True) if stay for n in s["effects"]}
    needed = {other for n in told for other in needed_beside(n, ())}
    gone = [s for s, stay in zip(naming, stays, strict=True) if not stay and not needed & {*s["effects"]}]
    return [s for s in steps if s not in gone], [n for s in gone for n in s["effects"]]


def _pays(fall: Gain, tolerance: Tolerance) -> bool:
    """Whether a fall of the error is beyond its standard error, in total or, by the tolerance, in one velocity."""
    return not np.isfinite(fall.std) or fall.value > fall.std or costs_in_one(fall, tolerance)


def _surely_costlier(one: Gain | None, other: Gain | None) -> bool:
    if one is None or other is None:
        return False
    return one.value - other.value > SURELY * float(np.hypot(one.std, other.std))


def names_by_worth(names: Sequence[str], costs: Mapping[str, Cost]) -> list[str]:
    """Return names in their order, those that matter first."""
    return sorted(names, key=lambda n: n in costs and not costs[n].matters)
