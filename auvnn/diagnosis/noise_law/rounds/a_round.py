"""Where one round of the search together with a stochastic force stands, and what it has found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.score_tests.null_tests import Tested

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Round:
    """Where one round of the search stands.

    Attributes:
        tested: tests of the effects that remain.
        current: the explanation without any of them.
        base: effects that are free whatever is chosen.
        chosen: effects found before.
        begins: values from which effects are fitted, too: while nothing is chosen those fitted one step ahead, the one
            that explains most first (`one_step_leaders`); then those fitted when nothing was chosen.
        null: the explanation without any name.
        alone: logarithm of the odds that effects brought when nothing was chosen, the largest first.
        places: how many more names may be given.
    """

    tested: Tested
    current: Hypothesis
    base: list[str]
    chosen: list[str]
    begins: Mapping[str, Array] = field(default_factory=dict)
    null: Hypothesis | None = None
    alone: Mapping[str, float] = field(default_factory=dict)
    places: float = math.inf


@dataclass(frozen=True)
class RoundResult:
    """What a round has found.

    Attributes:
        at: where it stood.
        found: what was fitted, the most evident first.
        good: what of it may be named.
        sure: p-value of each.
        among: how many effects were asked for.
    """

    at: Round
    found: list[Hypothesis]
    good: list[Hypothesis]
    sure: dict[str, float]
    among: int
