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


def costliest_first(
    steps: Sequence[SearchStep], costs: Mapping[str, Cost], tolerance: Tolerance
) -> list[SearchStep]:
    """Return the steps of a search, a name ahead of those found before it that surely cost less.

    What is found first brings most while the others are missing still: with many samples that may be a small fault of
    the model that the whole log shows, and what the predictions suffer from comes after it. Names whose costs do not
    differ by two standard errors stay in the order of the search, and so does every step that gives no name, and all of
    them where the tolerance is zero.

    Args:
        steps: what was found one after the other.
        costs: of the names of the fit; a group of names has that of the one that stands for it.
        tolerance: what does not matter.
    """
    if tolerance.strict:
        return list(steps)
    gains = [_largest(s, costs) for s in steps]
    named = [k for k, s in enumerate(steps) if s["verdict"] in NAMING and gains[k] is not None]
    order: list[int] = []
    for k in named:
        cheaper = (i for i, other in enumerate(order) if _surely_costlier(gains[k], gains[other]))
        order.insert(next(cheaper, len(order)), k)
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
    stays with it; and of several that do not pay the one that brings most, because each may stand in for the other,
    unless it surely makes predictions worse.

    Args:
        steps: in the order in which they are told.
        costs: of the names of the fit; a group of names has that of the one that stands for it.
        tolerance: what does not matter.
    """
    withdrawn = {e for s in steps if s["verdict"] == "withdrawn" for e in s["effects"]}
    naming = [s for s in steps if s["verdict"] in NAMING and not {*s["effects"]} <= withdrawn]
    if tolerance.strict or len(naming) < 2:
        return list(steps), []
    # A group of which one is missing goes as a whole; several that were named together go each by itself.
    units = [
        unit
        for s in naming[1:]
        for unit in ([s["effects"]] if s["verdict"] == "ambiguous" else [[e] for e in s["effects"]])
    ]
    idle: dict[tuple[str, ...], Gain] = {}
    for unit in units:
        fall = next((costs[n].gain for n in unit if n in costs), None)
        if fall is not None and not _pays(fall, tolerance):
            idle[tuple(unit)] = fall
    if len(idle) > 1:
        best = max(idle, key=lambda unit: idle[unit].value)
        if idle[best].value > -idle[best].std:
            del idle[best]
    gone = {n for unit in idle for n in unit}
    stay = [n for s in naming for n in s["effects"] if n not in gone]
    gone -= {other for n in stay for other in needed_beside(n, stay)}
    kept = []
    for s in steps:
        left = [n for n in s["effects"] if n not in gone or s["verdict"] not in NAMING]
        if left or not s["effects"]:
            kept.append(s if left == s["effects"] else SearchStep(**{**s, "effects": left}))
    return kept, [n for s in naming for n in s["effects"] if n in gone]


def _largest(step: SearchStep, costs: Mapping[str, Cost]) -> Gain | None:
    """Return the gain of a step's name, the largest of several that were named together; None where none is known."""
    gains = [g for n in step["effects"] if n in costs and (g := costs[n].gain) is not None]
    return max(gains, key=lambda g: g.value, default=None)


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
