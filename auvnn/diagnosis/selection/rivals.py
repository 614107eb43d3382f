"""Effects that might take the place of one that was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

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
