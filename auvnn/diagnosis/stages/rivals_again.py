"""Names compared with their rivals again, beside everything that was found, or given up, after them.

When a name is taken, causes that are found later are still in the errors, and names that are withdrawn later still beside
it: a rival that explained less then may explain more now.

Reference: Miller (2002), Subset Selection in Regression, 2nd ed., chapter 3 (sequential replacement).
"""

from __future__ import annotations

from collections.abc import Mapping

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.selection.rivals import Rivals, rivals_tried
from auvnn.diagnosis.stages.state import Setting, State

# Rivals of each name that are fitted in its place, those first that left least of the errors.
RIVALS = 2


def compared_again(asked: Setting, state: State) -> State:
    """Return the state with a rival in the place of a name beside whose others it explains more; then the search goes on.

    Where no rival explains more, those that the log cannot tell from a name are told together with it.

    Args:
        asked: what is asked.
        state: where the search has ended.
    """
    rivals = _rivals(state)
    if not rivals:
        return state
    asked.say(f"comparing {', '.join(rivals)} with rivals, beside what was found since")
    better, groups = asked.chooser(state.windows).in_place(state.current, asked.base, rivals)
    if better is not None:
        name, taken = better
        going = state.but(steps=tuple(s for s in state.steps if s["effects"]), ended=False)
        return _with_steps(_taken(going, taken), {name: [taken.effects[-1]]}).but(
            withdrawn=(*state.withdrawn, name)
        )
    if not groups:
        return state
    found = state
    for name, group in groups.items():
        if group[0].effects[-1] != name and found.current is state.current:
            # The plainer one stands for the group in what follows.
            found = _taken(found, group[0])
        elif group[0].effects[-1] != name:
            # Beside it the fits of another plainer one are out of date.
            group.sort(key=lambda e, name=name: e.effects[-1] != name)
        found = found.but(groups=(*found.groups, tuple(group)))
    return _with_steps(found, {name: [e.effects[-1] for e in group] for name, group in groups.items()})


def _taken(state: State, taken: FittedHypothesis) -> State:
    """Return the state with another explanation."""
    return state.but(
        current=taken, chosen=taken.effects, tried=(*state.tried, taken), path=(*state.path, taken)
    )


def _with_steps(state: State, instead: Mapping[str, list[str]]) -> State:
    """Return the state with other effects in the steps that gave some names."""
    told: list[SearchStep] = []
    for step in state.steps:
        names = [n for n in step["effects"] if n in instead and step["verdict"] != "withdrawn"]
        # Of several names that one step gave together the others stay.
        others = [n for n in step["effects"] if n not in names]
        if others or not names:
            told.append({**step, "effects": others})
        for new in (instead[n] for n in names):
            told.append({**step, "verdict": "ambiguous" if len(new) > 1 else "named", "effects": new})
    return state.but(steps=tuple(told))


def _rivals(state: State) -> Rivals:
    """Return what might take the place of each name, no group, and was not fitted yet beside all others."""
    names = [n for n in state.chosen if n not in state.in_groups]
    gone = {*state.chosen, *state.withdrawn, *state.in_groups}
    tried = [e for e in state.tried if e.effects and e.effects[-1] not in gone]
    able = rivals_tried(names, tried, state.first.fitted.sigma)
    compared = {frozenset(e.effects) for e in state.tried}
    found = {
        name: [e for e in of if frozenset([*state.chosen, e.effects[-1]]) - {name} not in compared][:RIVALS]
        for name, of in able.items()
    }
    return {name: of for name, of in found.items() if of}
