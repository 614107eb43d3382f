"""The search: fit what is uncertain, look for one effect after the other, ask what is left, and answer."""

from __future__ import annotations

from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.answers.answering import answer
from auvnn.diagnosis.stages.look import fit_null, look, regroup
from auvnn.diagnosis.stages.state import Searched, Setting
from auvnn.diagnosis.stages.what_is_left import what_is_left
from auvnn.metrics.windows import Windows


def search(asked: Setting, windows: Windows) -> tuple[Diagnosis, Searched]:
    """Search for what is missing.

    Args:
        asked: what is asked.
        windows: of the log.

    Returns:
        the answer, and where the search ended.

    Raises:
        FitError: what is uncertain cannot be fitted at all.
    """
    state = fit_null(asked, windows)
    while not state.ended:
        state = look(asked, state)
    state = what_is_left(asked, regroup(asked, state))
    return answer(asked, state), Searched(asked, state)
