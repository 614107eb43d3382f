"""The last stage of a search: is a force left that nobody has named, and what does that make of the names?

Nothing is adequate, and no name the whole cause, while a force is left that is beyond doubt and matters. Where the names
that were given leave much of it, or none of them is needed together with the force of a measured input that is left, they
are not given as causes: they are kept for what they predict where each of them improves the prediction, and else are the
nearest that the catalogue has. One of several that is not needed together with that force is withdrawn.
"""

from __future__ import annotations

import numpy as np

from auvnn.diagnosis.answers.effect_costs import small
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.residuals.additive_force_test import additive_force_test
from auvnn.diagnosis.residuals.variance_component_test import Unnamed, variance_component_test, white
from auvnn.diagnosis.stages.partial import kept
from auvnn.diagnosis.stages.search_round import ALPHA_NEXT, ALPHA_UNKNOWN
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.estimation.prediction_error import FitError

# A name that leaves a force is refuted on weaker grounds: to be silent about a cause costs less than a wrong one.
ALPHA_LEFT = 0.01
# Names that leave more than this share of what looks like a force have stood in for something without a name.
PARTIAL = 0.1
UNASKED = "whether a force without a name is left could not be asked: the sums of its test cannot be solved"


def what_is_left(asked: Setting, state: State) -> State:
    """Return the state as it stands once what nobody has named has been asked for; see the module's text."""
    asked.say("asking whether a force without a name is left")
    try:
        return _asked(asked, state)
    except np.linalg.LinAlgError:
        return state.but(notes=(*state.notes, UNASKED))


def _asked(asked: Setting, state: State) -> State:
    first, last = state.first, state.current
    noise = white(last, asked.floor)
    left = variance_component_test(last, state.windows, noise)
    state = state.but(remainder=left)
    # What was withdrawn is none of the names that stand.
    standing = {*last.effects, *state.in_groups}
    given = [
        e
        for s in state.steps
        if s["verdict"] in ("named", "ambiguous")
        for e in s["effects"]
        if e in standing
    ]
    if not given:
        return _ended(asked, state, left, left.p_value)
    own = [e for e in given if e in last.effects]
    state = state.but(unexplained=left.left_of(variance_component_test(first, state.windows, noise)))
    asked.say("asking whether a force of what is measured is left")
    traced = additive_force_test(last, asked.layout, state.windows, noise, own, ALPHA_NEXT)
    state = state.but(traced=traced)
    sure = traced.p_value < ALPHA_LEFT
    needless = list(traced.needless) if sure else []
    p_value = min(left.p_value, traced.p_value)
    much = state.unexplained > PARTIAL and p_value < ALPHA_LEFT
    none_needed = bool(own) and len(needless) == len(own)
    if none_needed or (much and not small(asked, state, left)):
        return _not_the_cause(asked, state, given)
    if needless:
        try:
            last = asked.chooser(state.windows).without(last, asked.base, needless)
        except FitError:
            return _ended(asked, state, left, p_value)
        state, gone = state.without_groups(needless)
        *before, end = state.steps
        step = {"verdict": "withdrawn", "effects": gone, "p_value": traced.p_value}
        state = state.but(current=last, chosen=last.effects, steps=(*before, step, end))
        return _unknown(state, left, p_value)
    return _ended(asked, state, left, p_value)


def _ended(asked: Setting, state: State, left: Unnamed, p_value: float) -> State:
    """Return the state with what is left told: nothing, a remainder that does not matter, or something unknown."""
    slow = state.steps[-1]["verdict"] == "unknown"
    if p_value >= ALPHA_UNKNOWN and not slow:
        return state
    if small(asked, state, left):
        *before, end = state.steps
        return state.but(steps=(*before, {**end, "verdict": "adequate"}), left=left, negligible=True)
    return _unknown(state, left, p_value) if p_value < ALPHA_UNKNOWN else state


def _unknown(state: State, left: Unnamed, p_value: float) -> State:
    """Return the state with a last step that says that a force is left."""
    *before, end = state.steps
    end = {**end, "verdict": "unknown", "p_value": min(end["p_value"], p_value)}
    return state.but(steps=(*before, end), left=left)


def _not_the_cause(asked: Setting, state: State, given: list[str]) -> State:
    """Return the state with names that are no cause: the nearest, until it is asked whether they predict."""
    p_value = state.steps[0]["p_value"]
    first: FittedHypothesis = state.first
    left = variance_component_test(first, state.windows, white(first, asked.floor))
    return state.but(
        refuted=state.current,
        current=first,
        chosen=(),
        groups=(),
        nearest=tuple(given),
        left=left,
        remainder=left,
        steps=({"verdict": "unknown", "effects": [], "p_value": p_value},),
    )


def without_stated(asked: Setting, state: State) -> State:
    """Return the state without names, where a force without a name is left and the first ones are of the model's effects.

    What the model says of an effect was seen elsewhere, and where the model lacks something, the values of its effects
    are the first to move: such a name is given where it leaves nothing that has a cause.

    Args:
        asked: what is asked.
        state: where the search ended.
    """
    named = [s["effects"] for s in state.steps if s["verdict"] in ("named", "ambiguous")]
    if not named or state.steps[-1]["verdict"] != "unknown" or not {*named[0]} <= {*asked.stated}:
        return state
    try:
        return _not_the_cause(asked, state, [e for effects in named for e in effects]).but(refuted=None)
    except np.linalg.LinAlgError:
        return state.but(notes=(*state.notes, UNASKED))


def settled(asked: Setting, state: State) -> State:
    """Return the state with names that are no cause kept for what they predict, where each earns its place.

    It takes a fit for each of them, and is asked once nothing else is left to be asked.
    """
    if state.refuted is None:
        return state
    own = [n for n in state.nearest if n in state.refuted.effects]
    asked.say("asking what the names predict")
    found = kept(asked, state.but(current=state.refuted), own)
    if found is None:
        return state.but(refuted=None)
    noise = white(found, asked.floor)
    left = variance_component_test(found, state.windows, noise)
    return state.but(
        refuted=None,
        current=found,
        chosen=found.effects,
        groups=(),
        nearest=found.effects,
        partial=True,
        left=left,
        remainder=left,
        unexplained=left.left_of(variance_component_test(state.first, state.windows, noise)),
        steps=({"verdict": "partial", "effects": [], "p_value": state.steps[0]["p_value"]},),
    )
