"""What the first search has found, each effect alone: candidates of the search together with a stochastic force.

An effect of another shape (a wave's period, the moment of a payload) is seldom where its slope at the null points. The
first search may have found it together with others only; its values there are where a fit of it alone begins.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.model_comparison import confused
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.effects import effect_class
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters

Array = NDArray[np.float64]
STEPS = 6
# Effects that are known to be confused with the one that leads: so many of them are fitted in full.
RIVALS = 2


def rivals_of(
    found: Sequence[Hypothesis], scores: Mapping[str, Score], level: float, *, among_all: bool = True
) -> list[str]:
    """Return effects to fit because the catalogue knows them to be confused with the most evident one.

    An effect with many parameters may lead because it imitates one with few, which leads nowhere by itself: a cable of
    which more is dragged the farther the vehicle goes is drag that grows with time.

    Args:
        found: explanations that were judged.
        scores: of the tests, by effect.
        level: at which chance is rejected.
        among_all: whether all effects are asked for, or the few that are confused with the leader.
    """
    if not found:
        return []
    best, known = max(found, key=lambda h: h.evidence), {h.name for h in found}
    sure = level / max(sum(s.degrees > 0 for s in scores.values()), 1) if among_all else level
    names = [n for n, s in scores.items() if n not in known and s.degrees and confused(best.name, n)]
    names = [n for n in names if scores[n].p_value < sure]
    return sorted(names, key=lambda n: -scores[n].evidence)[:RIVALS]


def contained_in(
    layout: Layout, found: Sequence[Hypothesis], current: Hypothesis, open_to: Container[str]
) -> dict[str, Array]:
    """Return the plainer effects that those which explain something contain, each with values from which to fit it.

    A lag of seconds is an overshoot whose excess is -1, and its own slope at the null does not lead there.

    Args:
        layout: for what the effects' parameters are.
        found: explanations that were fitted.
        current: the explanation without their last effects.
        open_to: effects that may be named.
    """
    begins, known = {}, {h.name for h in found}
    for h in found:
        values = h.explanation.fitted.model.effect(h.name).values()
        for name, shared in effect_class(h.name).contains.items():
            # With nothing in common it begins at its null, as any fit of it does.
            again = bool(shared) or name not in known
            if again and name in open_to and h.evidence > current.evidence:
                described = layout.described(name)
                begins[name] = np.array([values[p.name] if p.name in shared else p.null for p in described])
    return begins


def fitted_alone(asked: Setting, state: State) -> list[FittedHypothesis]:
    """Return every effect that the first search fitted alone, and those that it named together with others, each alone.

    Args:
        asked: what is asked.
        state: where the first search ended.
    """
    alone = [e for e in state.tried if len(e.effects) == 1]
    named = dict.fromkeys(n for s in state.steps if s["verdict"] != "withdrawn" for n in s["effects"])
    for name in named:
        source = next((e for e in reversed(state.tried) if name in e.effects), None)
        if source is None or any(e.effects == (name,) for e in alone):
            continue
        with suppress(FitError):
            alone.append(_alone(asked, state, name, parameters_of(source.fitted.model, [name])))
    return alone


def sensing_alone(asked: Setting, state: State) -> Iterator[FittedHypothesis]:
    """Yield fits of the effects that change what the sensors report, each alone; one is fitted as it is asked for.

    Args:
        asked: what is asked.
        state: where the first search ended.
    """
    tried = {e.effects[0]: e for e in state.tried if len(e.effects) == 1}
    for name in asked.usable:
        if "sense" in effect_class(name).hooks():
            with suppress(FitError):
                yield tried[name] if name in tried else _alone(asked, state, name)


def _alone(asked: Setting, state: State, name: str, values: Array | None = None) -> FittedHypothesis:
    """Return an effect fitted alone, from values of its parameters or from the null."""
    asked.say(f"fitting {name} alone")
    model = asked.layout.model.rebuilt(asked.layout.model.copied_effects())
    set_parameters(model, state.first.names, state.first.fitted.theta)
    if values is not None:
        set_parameters(model, [name], values)
    return fit_hypothesis(
        asked.layout,
        state.windows,
        asked.base,
        [name],
        start=state.first.fitted,
        guess=replace(asked.layout, model=model),
        sigma=state.first.fitted.sigma,
        iterations=STEPS,
    )
