"""Effects that might take the place of one that was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.selection.model_comparison import confused

Array = NDArray[np.float64]
# Of each effect what might take its place.
Rivals = Mapping[str, Sequence[FittedHypothesis]]


def rivals_tried(names: Iterable[str], tried: Iterable[FittedHypothesis], sigma: Array) -> Rivals:
    """Return what might take the place of each of some effects, of fits without the force, what leaves least first.

    Args:
        names: of the effects.
        tried: explanations, perhaps with several effects, of which the last counts.
        sigma: (18,) by which all of them are weighed.
    """
    least: dict[str, FittedHypothesis] = {}
    for e in sorted((e for e in tried if e.effects), key=lambda e: e.squared_error(sigma)):
        least.setdefault(e.effects[-1], e)
    return {name: [e for n, e in least.items() if confused(n, name)] for name in names}


def without_lost(
    steps: Sequence[SearchStep], groups: Sequence[Sequence[FittedHypothesis]], lost: Set[tuple[str, str]]
) -> tuple[list[SearchStep], list[list[FittedHypothesis]]]:
    """Return steps and groups without the rivals that have lost; a name that is left alone makes no group.

    Args:
        steps: of the search.
        groups: explanations that could not be told apart, the one that leads first.
        lost: name of the one that leads, and of its rival.
    """
    kept: list[list[FittedHypothesis]] = []
    for group in groups:
        lead = group[0].effects[-1]
        left = [e for e in group if (lead, e.effects[-1]) not in lost]
        kept += [left] if len(left) > 1 else []
    told: list[SearchStep] = []
    for step in steps:
        names = [n for n in step["effects"] if (step["effects"][0], n) not in lost]
        alone = step["verdict"] == "ambiguous" and len(names) == 1
        told.append({**step, "verdict": "named" if alone else step["verdict"], "effects": names})
    return told, kept
