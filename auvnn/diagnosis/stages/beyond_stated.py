"""A coefficient group that the log moves beyond what was stated of it, where nothing else is missing.

What is uncertain anyway follows the log, so that freeing it further predicts no better, and a search by what is left
finds nothing: with such coefficients the model is adequate. With those of its file it is not, where they depart from what
was stated by more than chance has it. Then the group is what is wrong with the model, and has a name.

It is named where it alone has departed. Several groups that move together are what a fit makes of a form that the model
does not have.

Reference: Evans and Moshonov (2006), Checking for prior-data conflict, Bayesian Analysis 1(4) 893-914.
"""

from __future__ import annotations

from dataclasses import replace

from scipy.stats import chi2

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.answers.table import fill_candidate
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.noise_law.rounds.free_running_cost import HORIZON, as_stated, free_running_cost
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.rollouts import roll, scale_of

# Levels at which chance is rejected: for the group that is named, and for others that then have moved as well.
ALPHA_GROUP, ALPHA_OTHERS = 1e-4, 1e-2


def beyond_stated(asked: Setting, state: State) -> State:
    """Return the state with the coefficient group as its name that alone has departed from what was stated of it.

    Args:
        asked: what is asked.
        state: where the search ended; one that is not adequate without any name stays as it is.
    """
    if state.chosen or not state.steps or state.steps[-1]["verdict"] != "adequate":
        return state
    surprise = departures(asked.layout, state.current)
    able = {name: p for name, p in surprise.items() if name in asked.usable}
    name = min(able, key=lambda n: able[n], default=None)
    if name is None or len(surprise) * able[name] >= ALPHA_GROUP:
        return state
    asked.say(f"fitting {name} beyond what is stated of it")
    try:
        found = fit_hypothesis(
            asked.layout, state.windows, asked.base, (name,), start=state.current.fitted,
            guess=replace(asked.layout, model=state.current.fitted.model), sigma=state.current.fitted.sigma,
        )  # fmt: skip
    except UNSOLVED:
        # The answer stands as it was: it did not need what could not be solved here.
        return state
    others = [p for other, p in departures(asked.layout, found).items() if other != name]
    if others and len(others) * min(others) < ALPHA_OTHERS:
        return state
    if not _matters(asked, found):
        return state
    step: SearchStep = {"verdict": "named", "effects": [name], "p_value": len(surprise) * able[name]}
    return state.but(
        current=found,
        chosen=(name,),
        table=fill_candidate(asked.layout, state.table, found, state.first),
        tried=(*state.tried, found),
        steps=(step, *state.steps),
        # What explained a part of it before the group was free is not nearest to a cause any more.
        nearest=(),
    )


def departures(layout: Layout, found: FittedHypothesis) -> dict[str, float]:
    """Return how seldom chance moves each stated group so far from what was stated of it, by chi-square.

    A group that a fit has as its own effect is free, and not among them.

    Args:
        layout: stated values.
        found: the fit.
    """
    out: dict[str, float] = {}
    for name, own in layout.places(found.names).items():
        spread = layout.spreads.get(name)
        if spread is None or name in found.effects or name not in layout.nuisance or name == "learned_drag":
            continue
        away = (found.fitted.theta[own] - layout.means[name]) / spread
        # What the log does not show stays where it was stated, and counts as a degree of freedom nevertheless.
        out[name] = float(chi2.sf(float(away @ away), len(own)))
    return out


def _matters(asked: Setting, found: FittedHypothesis) -> bool:
    """Whether free running is worse by the tolerance with the group as stated, the rest refitted or left as it is."""
    if asked.tolerance.strict:
        return True
    scale = scale_of(asked.log)
    model = found.fitted.model.without_absent(found.effects)
    if roll(model, asked.log, HORIZON, scale) is None:
        # What no model of these can predict tells nothing of its coefficients.
        return False
    costs = [
        free_running_cost(model, other, asked.log, scale).error for other in as_stated(asked.layout, found)
    ]
    return min(costs) >= asked.tolerance.cost
