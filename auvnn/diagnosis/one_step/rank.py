"""Which effect pays one step ahead? The whole catalogue by accelerations, judged on parts of the log left out.

Where waves, held samples or a tank's own flow limit a free run, errors one step ahead tell more than those of free
running. First everything that is uncertain without any candidate is refitted: coefficients within their stated
uncertainty, and the effects that the model has already. Then each candidate is fitted beside it, at first cheaply, with
the slopes of everything else as they were; those that lead, or are tied with the one that does, are fitted again jointly
with everything else, one after the other and six at most. What is left out is a fifth of every run in
turn, so that every part of the fit has seen every kind of motion.

A parameter that says how an effect acts and not how much (an onset, a frequency, a slack length) stays at the best of the
values that the effect offers to begin with, chosen on what is fitted.

Reference: Klein and Morelli (2006), Aircraft System Identification, section 5, for equation error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import plain
from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.diagnosis.one_step.refit import OneStepRefit, RefittedEffect
from auvnn.diagnosis.one_step.weighted_fit import standard_error
from auvnn.effects import effect_class
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative
from auvnn.models import GreyBox

Array = NDArray[np.float64]

LEADERS, MOST = 3, 6
"""So many of those that lead are fitted again jointly at least, and at most where ever others lead."""


@dataclass(frozen=True)
class Ranked:
    """What one effect gains one step ahead.

    Args:
        effect: its name.
        before: weighted squared error per sample on what was left out, without it, everything else refitted.
        after: with it, everything else refitted.
        std: standard error of the difference.
        values: its parameters as fitted, by name.
        behind: by how much its error is larger than that of the best.
        behind_std: standard error of that.
        jointly: whether everything else was fitted again with it, slopes and all.
    """

    effect: str
    before: float
    after: float
    std: float
    values: dict[str, float]
    behind: float = 0.0
    behind_std: float = 0.0
    jointly: bool = False

    @property
    def tied(self) -> bool:
        """Whether the best is better by no more than the uncertainty of the difference: one group with it."""
        return self.behind <= self.behind_std

    @property
    def gain(self) -> float:
        """By how much the error falls."""
        return self.before - self.after

    @property
    def pays(self) -> bool:
        """Whether it falls by more than its own uncertainty."""
        return self.gain > self.std

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        names = (
            "effect",
            "before",
            "after",
            "gain",
            "std",
            "pays",
            "values",
            "behind",
            "behind_std",
            "tied",
            "jointly",
        )
        return plain({n: getattr(self, n) for n in names})


def rank_one_step(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    derivative: Any = None,
    progress: Callable[[str], None] | None = None,
) -> list[Ranked]:
    """Rank effects by what they gain one step ahead on parts of the log left out, best first.

    Where the best is tied with an effect that it contains (`plainer`), the plainer one comes first.

    Args:
        model: the model, without them.
        log: measurements.
        effects: names to consider; the whole catalogue by default.
        derivative: how accelerations are obtained, as `compare` takes it.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown effect.
        InputError: the log lacks the commands that drive the model, or has no sample with state, command and
            acceleration.
    """
    say = progress or (lambda words: None)
    usable, _ = candidates_for(model, log, effects)
    say("refitting what is uncertain without any candidate")
    beside = OneStepRefit(model, log, choose_derivative(log, derivative))
    points: dict[str, RefittedEffect] = {}
    for name in usable:
        say(f"trying {name}")
        point = beside.alone(name)
        if point is not None:
            points[name] = point
    jointly: set[str] = set()
    while True:
        order = _ordered(points, beside, jointly)
        ahead = [
            r.effect for k, r in enumerate(order) if (k < LEADERS or (r.tied and r.pays)) and not r.jointly
        ]
        if not ahead:
            return _plainer_first(order)
        for name in ahead:
            say(f"fitting {name} jointly")
            points[name] = beside.jointly(name, points[name])
            jointly.add(name)


def _ordered(points: dict[str, RefittedEffect], beside: OneStepRefit, jointly: set[str]) -> list[Ranked]:
    """Return effects by what they gain, with how far each is behind the best."""
    errors, found = {}, []
    for name, point in points.items():
        difference = beside.before - point.after
        rows = np.isfinite(difference)
        before, after = float(beside.before[rows].mean()), float(point.after[rows].mean())
        std = standard_error(difference[rows], beside.block[rows])
        errors[name] = difference
        found.append(Ranked(name, before, after, std, point.values, jointly=name in jointly))
    found.sort(key=lambda r: -r.gain)
    return [r if k == 0 else _behind(r, errors[found[0].effect] - errors[r.effect], beside.block)
            for k, r in enumerate(found)]  # fmt: skip


def _behind(ranked: Ranked, difference: Array, block: NDArray[np.int64]) -> Ranked:
    """Return an effect with how far its gain is behind that of the best, over the samples that both have."""
    both = np.isfinite(difference)
    if not both.any():
        return replace(ranked, behind=float("inf"))
    std = standard_error(difference[both], block[both])
    return replace(ranked, behind=float(difference[both].mean()), behind_std=std)


def _plainer_first(order: list[Ranked]) -> list[Ranked]:
    """Return the ranking, of those tied with the best the ones that it contains first."""
    if not order:
        return order
    plainer = effect_class(order[0].effect).plainer
    return sorted(order, key=lambda r: not (r.effect in plainer and r.tied and r.pays))
