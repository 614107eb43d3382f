"""The search: fit what is uncertain, look for one effect after the other, ask what is left."""

from __future__ import annotations

from collections.abc import Callable

from auvnn.diagnosis.stages.search_round import fit_null, regroup, search_round
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.diagnosis.stages.what_is_left import what_is_left
from auvnn.metrics.windows import Windows


def search(asked: Setting, windows: Windows, worthwhile: Callable[[State], bool] | None = None) -> State:
    """Search for what is missing.

    Args:
        asked: what is asked.
        windows: of the log.
        worthwhile: asked after every round; where it is not, the search is given up as it stands.

    Returns:
        where the search ended; whether names that are no cause predict is still open then (`stages.what_is_left`).

    Raises:
        FitError: what is uncertain cannot be fitted at all.
    """
    state = fit_null(asked, windows)
    while not state.ended:
        state = search_round(asked, state)
        if worthwhile is not None and not worthwhile(state):
            return state
    return what_is_left(asked, regroup(asked, state))
