"""What a diagnosis asks where its first search leaves a force: of commands between samples, and of a stochastic force.

Where the first search leaves nothing, its answer stands as it is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.answers.table import values
from auvnn.diagnosis.hypotheses.layout import Layout
from auvnn.diagnosis.noise_law.command_holding import Holding, between, holding, squared_error
from auvnn.diagnosis.noise_law.foretold import foretold
from auvnn.diagnosis.noise_law.hypothesis import BesideForce
from auvnn.diagnosis.noise_law.law import ALPHA_BOUNDARY, left
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.residuals.variance_component import variance_component_test, white
from auvnn.diagnosis.search import search
from auvnn.diagnosis.stages.state import Searched

# Share of a degree of freedom's force that measured inputs may foretell (lower 95 % limit) before it is no noise.
FORETOLD = 0.1


def beside_what_is_left(found: Diagnosis, under_way: Searched) -> tuple[Diagnosis, Searched]:
    """Return the answer and the search that led to it, once what is left has been asked for.

    Args:
        found: of the first search.
        under_way: where that ended.
    """
    if found.verdict == "adequate":
        return found, under_way
    asked = under_way.setting
    held = _held(under_way)
    if held.odds > 0.0:
        asked.say(f"commands change between samples ({held.name}): searching again")
        found, under_way = search(asked, held.applied(under_way.state.windows))
    found = replace(found, stochastic={"commands": held.to_dict()})
    return _beside_force(found, under_way), under_way


def _held(under_way: Searched) -> Holding:
    """Return how commands go between samples, by the explanation that leaves least, whatever the search made of it."""
    state = under_way.state
    ends = [state.first, *state.tried, state.current]
    sigma = state.first.fitted.sigma
    return holding(min(ends, key=lambda e: squared_error(e, sigma)), state.windows)


def _beside_force(found: Diagnosis, under_way: Searched) -> Diagnosis:
    """Return the answer with the stochastic force that is left, and the names that stand beside it."""
    asked, windows, floor = under_way.setting, under_way.state.windows, under_way.floor
    last = under_way.state.current
    if variance_component_test(last, windows, white(last, floor)).p_value >= ALPHA_BOUNDARY:
        return found
    beside = ForceSearch(asked.layout, windows, asked.usable, asked.base, asked.say)
    null = beside.begin(under_way.first, white(under_way.first, floor))
    if null is None:
        return found
    alone = [e for e in under_way.state.tried if len(e.effects) == 1]
    result = beside.run(null, alone, asked.most)
    asked.say("asking how much of the force measured inputs foretell")
    told = foretold(result.last, result.windows)
    if told is not None and told.least > FORETOLD:
        words = (
            f"{told.input} foretells {told.share:.0%} of the force in {told.axis} that is left "
            f"(at least {told.least:.0%}): it is no chance, and has no name"
        )
        return replace(found, warnings=[*found.warnings, words])
    found = replace(found, stochastic={**found.stochastic, "force": left(result.estimate.law)})
    return _answer(found, asked.layout, result)


def _answer(found: Diagnosis, layout: Layout, result: BesideForce) -> Diagnosis:
    """Put what was found beside the force in the place of what the first search found."""
    gone = {e for s in result.steps if s["verdict"] == "withdrawn" for e in s["effects"]}
    given = [e for e in result.names if e not in gone]
    end: dict[str, Any] = {"verdict": "unknown", "effects": [], "p_value": found.global_p_value}
    standing = [s for s in result.steps if s["verdict"] != "withdrawn" and not {*s["effects"]} <= gone]
    steps = [*result.steps, end]
    if standing:
        # What is left beside the names is stochastic, and told as such.
        steps = list(result.steps)
    leading = standing[0] if standing else end
    by_name = {c["effect"]: c for c in found.candidates}
    for explanation in (*result.tried, result.last):
        if not explanation.effects:
            continue
        for name, parameters in values(layout, explanation, explanation.effects).items():
            if name in by_name:
                by_name[name]["parameters"] = parameters
    order = [c for n in given for c in [by_name[n]]] + [
        c for c in found.candidates if c["effect"] not in given
    ]
    missing = leading["effects"] if leading["verdict"] == "ambiguous" else given
    return replace(
        found,
        verdict=leading["verdict"],
        missing=list(missing),
        steps=steps,
        candidates=order,
        explanation=result.last,
        nearest=[] if given else found.nearest,
        unexplained=found.unexplained if not given else float(np.clip(_share_left(result), 0.0, 1.0)),
    )


def _share_left(result: BesideForce) -> float:
    """Return the stochastic force's share of what was above noise before any name."""
    before, law = result.first_law, result.estimate.law
    if law is None or before is None:
        return 0.0
    known = before.rms > 0.0
    return float(((law.rms[known] / before.rms[known]) ** 2).mean())
