"""The search: fit what is uncertain, look for one effect after the other, ask what is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.measured_start import GROSS, above_noise, noise_share
from auvnn.diagnosis.residuals.variance_component_test import variance_component_test, white
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.stages.rivals_again import compared_again
from auvnn.diagnosis.stages.search_round import ALPHA_UNKNOWN, fit_null, regroup, search_round
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.diagnosis.stages.what_is_left import what_is_left
from auvnn.metrics.windows import Windows

# Share of what looks like a force that may stay after one round, and after more, before names alone will not do.
STAYS_AT_FIRST, STAYS = 0.9, 0.5
# Where most of the error is left, a name must take this share of what is above the noise for the search to go on.
EACH = 0.25


def search(
    asked: Setting,
    windows: Windows,
    worthwhile: Callable[[State], bool] | None = None,
    until: Callable[[Setting, State], bool] | None = None,
    promising: Callable[[State, Mapping[str, Score]], bool] | None = None,
) -> State:
    """Search for what is missing.

    Args:
        asked: what is asked.
        windows: of the log.
        worthwhile: asked after every round; where it is not, the search is given up as it stands.
        until: asked after every round; where it holds, the search ends there, and what is left is unknown.
        promising: asked of the tests of every round, see `search_round`; where they are not, the search is given up as
            it stands.

    Returns:
        where the search ended; whether names that are no cause predict is still open then (`stages.what_is_left`).

    Raises:
        FitError: what is uncertain cannot be fitted at all.
    """
    state = fit_null(asked, windows)
    while not state.ended:
        before, state = state, search_round(asked, state, promising)
        if state is before:
            return state
        if worthwhile is not None and not worthwhile(state):
            return state
        if until is not None and not state.ended and until(asked, state):
            state = state.step("unknown", [], state.p_value).but(ended=True, interrupted=True)
        if state.ended and not state.interrupted:
            state = compared_again(asked, state)
    return what_is_left(asked, regroup(asked, state))


def a_force_stays(asked: Setting, state: State) -> bool:
    """Whether names leave so much of a force that further ones alone will not explain it.

    Then names are better sought together with a stochastic force than one after the other without. So they are where
    free running goes so far off that a name takes little of the error: slopes of such runs rank names by chance.

    Args:
        asked: what is asked.
        state: after a round.
    """
    rounds = len(state.path)
    if not rounds:
        return False
    try:
        before = variance_component_test(state.first, state.windows, white(state.first, asked.floor))
        left = variance_component_test(state.current, state.windows, white(state.current, asked.floor))
    except np.linalg.LinAlgError:
        return False
    if not left.p_value < ALPHA_UNKNOWN:
        return False
    most = STAYS_AT_FIRST if rounds == 1 else STAYS
    return left.left_of(before) > most or _takes_little(
        state.path[-2] if rounds > 1 else state.first, state.current
    )


def _takes_little(before: FittedHypothesis, after: FittedHypothesis) -> bool:
    """Whether most of the error is left and a name has taken little of it away.

    Args:
        before: explanation without it.
        after: explanation with it.
    """
    most_is_left = noise_share(after.fitted) < GROSS
    return most_is_left and above_noise(after.fitted) > (1.0 - EACH) * above_noise(before.fitted)
