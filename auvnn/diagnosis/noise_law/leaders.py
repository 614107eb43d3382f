"""What the first search has found, each effect alone: candidates of the search together with a stochastic force.

An effect of another shape (a wave's period, the moment of a payload) is seldom where its slope at the null points. The
first search may have found it together with others only; its values there are where a fit of it alone begins.
"""

from __future__ import annotations

from dataclasses import replace

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters

STEPS = 6


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
        asked.say(f"fitting {name} alone")
        model = asked.layout.model.rebuilt(asked.layout.model.copied_effects())
        set_parameters(model, state.first.names, state.first.fitted.theta)
        set_parameters(model, [name], parameters_of(source.fitted.model, [name]))
        try:
            alone.append(
                fit_hypothesis(
                    asked.layout,
                    state.windows,
                    asked.base,
                    [name],
                    start=state.first.fitted,
                    guess=replace(asked.layout, model=model),
                    sigma=state.first.fitted.sigma,
                    iterations=STEPS,
                )
            )
        except FitError:
            continue
    return alone
