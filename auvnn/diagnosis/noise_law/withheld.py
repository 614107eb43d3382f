"""Whether names that were found beside a stochastic force are given, by what they leave of it; and the state then."""

from __future__ import annotations

import numpy as np

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.answers.table import fill_candidate
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.hypothesis import WithForce, shares_left
from auvnn.diagnosis.noise_law.left_force import (
    beyond_actuators,
    exceeds_actuators,
    negligible,
    sized_by_law,
)
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.force_law import ForceLaw

# Share of the force beyond which a name has left most of it.
MOST = 0.5
# A name that leaves less than this share of what there was has explained a force that is too large for a disturbance.
EXPLAINED = 0.25


def withheld(asked: Setting, state: State, result: WithForce, *, chance: bool) -> bool:
    """Whether names are not given because of what they leave, or because the model predicts worse with them.

    What they leave withholds none where the first one explains far more than everything it is not confused with, and,
    where nothing that is measured predicts the force that is left, where the first one leaves next to nothing of it in a
    degree of freedom, or all of them leave little, or no more than a disturbance of what was too large for one: then what
    is left has another cause. Names that together make free running worse are given where the first one explains so much
    more alone.

    Args:
        asked: layout.
        state: windows over which the force was sought.
        result: what was found.
        chance: whether nothing that is measured predicts the force that is left.
    """
    if result.worsens and not result.stands_out:
        return True
    if not refuted(asked, state, result.compared, share_left(result), chance=chance):
        return False
    explain = result.explains or explain_an_axis(result) or leave_a_disturbance(asked, state, result)
    return not (result.stands_out or (chance and explain))


def explain_an_axis(result: WithForce) -> bool:
    """Whether several names together have explained the force in a degree of freedom.

    Each of two causes leaves what the other one explains, and next to nothing is left where both are named.

    Args:
        result: what was found.
    """
    if result.first_law is None or len(result.steps) < 2:
        return False
    return bool((shares_left(result.compared, result.first_law) < EXPLAINED).any())


def leave_a_disturbance(asked: Setting, state: State, result: WithForce) -> bool:
    """Whether names leave little of a force that was too large for a disturbance, and what is left is not, in one axis.

    A centre of gravity that is missing turns a vehicle over, whatever a tank does to its heave.

    Args:
        asked: layout.
        state: windows over which the force was sought.
        result: what was found.
    """
    before = result.first_law
    if before is None:
        return False
    left = np.ones(6)
    left[before.axes] = shares_left(result.compared, before)
    # Beside the actuators it counts as the force that it is with the names.
    eased = beyond_actuators(asked, state, before) & ~beyond_actuators(asked, state, result.estimate.law)
    return bool((eased & (left < EXPLAINED)).any())


def refuted(asked: Setting, state: State, law: ForceLaw | None, share: float, *, chance: bool) -> bool:
    """Whether what is left says that names are not the cause.

    A force that follows from what is measured is no noise: names beside which most of it stays are not its cause. Nor
    are names beside which a force stays that is too large for a disturbance, unless they have explained most of it.

    Args:
        asked: layout.
        state: windows over which the force was sought.
        law: of the stochastic force that is left; None where none was found.
        share: of the force, before any name, that is left.
        chance: whether nothing that is measured predicts it.
    """
    if not chance and share > MOST:
        return True
    return share > EXPLAINED and exceeds_actuators(asked, state, law)


def goes_further(again: WithForce, before: WithForce) -> bool:
    """Whether further names after the same ones leave less than half of a force of which those leave more.

    Names that leave most of a force that measured inputs predict are withheld: with several causes at once the first of
    them leaves most, however right it is.

    Args:
        again: the search that also looks at names that cost little or bring little.
        before: the search that does not.
    """
    # Beside further names the log may tell apart what it could not before.
    pairs = list(zip(again.steps, before.steps, strict=False))
    same = len(pairs) == len(before.steps) and all(
        a["effects"][0] == b["effects"][0] and {*a["effects"]} <= {*b["effects"]} for a, b in pairs
    )
    return bool(before.steps) and same and share_left(before) > MOST >= share_left(again)


def share_left(result: WithForce) -> float:
    """Return the stochastic force's share of what was above noise before any name.

    Args:
        result: what was found.
    """
    if result.compared is None or result.first_law is None:
        return 0.0
    left = shares_left(result.compared, result.first_law)
    return float(np.clip(left.mean(), 0.0, 1.0))


def state_with(
    asked: Setting,
    state: State,
    over: State,
    result: WithForce,
    uncertain: UncertainWrench,
    *,
    chance: bool,
) -> State:
    """Return the state with what was found together with the force in the place of what the first search found.

    Args:
        asked: what is asked.
        state: where the first search ended.
        over: the same with the windows over which the force was sought, and the fit without a name over these.
        result: what was found.
        uncertain: what commands between samples leave uncertain.
        chance: whether nothing that is measured predicts the force that is left.
    """
    law = result.estimate.law
    small = chance and negligible(asked, state, law, uncertain)
    table = state.table
    for explanation in result.tried:
        table = fill_candidate(asked.layout, table, explanation, over.first)
    share = share_left(result)
    named = [] if withheld(asked, state, result, chance=chance) else list(result.steps)
    tried = [e for s in result.steps for e in s["effects"]]
    end: SearchStep = {
        "verdict": "adequate" if small else "unknown",
        "effects": [],
        "p_value": state.p_value,
    }
    # What is left beside the names is stochastic, and reported as such; or it has no name, and is unknown.
    steps = [*named, end] if small or not (chance and named) else named
    before = [e for s in state.steps for e in s["effects"]]
    notes = state.notes
    if not named and result.worsens and tried:
        notes = (
            *notes,
            f"{', '.join(dict.fromkeys(tried))}: not given, for with them free running is worse than without",
        )
    return (over if named else state).but(
        notes=notes,
        current=result.last if named else state.first,
        chosen=result.last.effects if named else (),
        groups=tuple(tuple(group) for group in result.groups) if named else (),
        withdrawn=(),
        steps=tuple(steps),
        table=table,
        left=None if named or small else state.left,
        traced=None,
        remainder=sized_by_law(state.remainder, law if named else result.first_law, over.windows),
        negligible=small,
        nearest=() if named else tuple(dict.fromkeys([*tried, *state.nearest, *before])),
        partial=False,
        refuted=None,
        unexplained=share if named else state.unexplained,
    )
