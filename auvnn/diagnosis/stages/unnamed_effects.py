"""What effects without a name would move, where a search for names alone has ended."""

from __future__ import annotations

from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.selection.moved_by_unnamed import moved_by_unnamed, widened
from auvnn.diagnosis.stages.state import Setting, State


def beside_unnamed(asked: Setting, state: State) -> State:
    """Return the state with what effects without a name would move as a part of the standard errors of those with one.

    Where names were found together with a stochastic force, that search has told it already.

    Args:
        asked: what is asked.
        state: where the search ended.
    """
    found = state.current
    if not found.effects or found.under_law is not None:
        return state
    base = [*asked.base, *(n for n in found.effects if n not in asked.base)]
    tested = state.last_tests[1] if state.last_tests and state.last_tests[0] is found else None
    try:
        if tested is None:
            others = [n for n in asked.usable if n not in {*found.effects, *state.withdrawn, *state.rivals}]
            asked.say(f"testing {len(others)} effects beside the names")
            tested = asked.tests(state.windows)(found, others, base, list(found.effects))
        return state.but(current=widened(found, moved_by_unnamed(state.windows, found, tested, base)))
    except UNSOLVED:
        # The answer stands as it was: it did not need what could not be solved here.
        return state
