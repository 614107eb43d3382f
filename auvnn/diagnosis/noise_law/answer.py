"""What a diagnosis asks where its first search leaves a force: of commands between samples, and of a stochastic force.

Where the first search leaves nothing, its answer stands, but for names that another law of the commands replaces.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.early import clearly_between_samples
from auvnn.diagnosis.noise_law.commands.holding import cost_at_best, cost_with, fitted_to, holding
from auvnn.diagnosis.noise_law.commands.in_place_of_names import (
    in_place_of_names,
    kept_as_stated,
    replaced,
    replaces,
    without,
    without_timed,
)
from auvnn.diagnosis.noise_law.commands.later import late_by_a_share
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.diagnosis.noise_law.commands.stated import StatedCommands
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench, uncertain_wrench
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.noise_law.left_force import leaves_force
from auvnn.diagnosis.noise_law.noise_colour import Colour, clearly_coloured, noise_colour
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.rounds.leaders import fitted_alone, sensing_alone
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.noise_law.split_windows import fitted_over_parts
from auvnn.diagnosis.noise_law.standing_names import beside_names, stand
from auvnn.diagnosis.noise_law.withheld import goes_further, state_with, withheld
from auvnn.diagnosis.noise_law.words import left
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.diagnosis.search import a_force_stays, search
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.diagnosis.stages.what_is_left import settled
from auvnn.metrics.commands.stated import interval_of
from auvnn.metrics.force_law import ForceLaw

Array = NDArray[np.float64]
CONTRADICTED = (
    "commands do not go between the samples of this log as the model states it: it was asked without that"
)
UNDECIDED = (
    "names were not compared together with a stochastic force: with one, free running grows without bound; "
    "choose shorter windows with window="
)


def ends_early(asked: Setting, state: State) -> bool:
    """Whether a search for names alone ends after a round, because it will be made again.

    Beside a stochastic force, where names leave most of one; with another colour of the noise or other commands between
    samples, where that is clear after the first name: with held commands one false name after the other would be found.

    Args:
        asked: what is asked.
        state: after a round.
    """
    if a_force_stays(asked, state):
        return True
    try:
        return (
            len(state.path) == 1
            and leaves_force(asked, state, state.current)
            and (
                clearly_coloured(state.current, state.windows, asked.floor)
                or (
                    asked.commands is None
                    and clearly_between_samples(asked.layout, state.current, state.windows)
                )
            )
        )
    except UNSOLVED:
        return False


def answer_with_force(asked: Setting, state: State) -> tuple[State, dict[str, Any], list[str]]:
    """Return where the search stands once what is left has been asked for, what was found of it, and words.

    Args:
        asked: what is asked.
        state: where the first search ended.
    """
    began, stated = state, asked.commands
    kept = None if stated is None else kept_as_stated(asked, state, _by_size(state)[0])
    if stated is not None and kept is None:
        return _unstated(asked, state, stated)
    if not state.leaves_something:
        if kept is not None:
            return _names_alone(asked, began, state, {"commands": kept.to_dict()}, [])
        return _names_alone(asked, began, *_with_fewer_names(asked, state))
    read, gone = state.windows if stated is None else stated.as_read(state.windows), dict[str, str]()
    if kept is None:
        least, held = _held(asked.layout, state)
        untimed = without_timed(asked, state, least)
        law = None if untimed is None else replaces(untimed, least, held, read, asked.layout)
        if untimed is not None and law is not None:
            gone = replaced(untimed, least)
            asked, least, held = without(asked, gone), untimed, law
        with suppress(*UNSOLVED):
            held = with_share(asked.layout, least, read, held)
    else:
        least, held = _by_size(state)[0], kept
    windows = held.applied(read)
    try:
        # By errors with commands as read, as it is asked of all logs.
        about = least if kept is None else fitted_to(asked.layout, least, read)
        uncertain = uncertain_wrench(about, read, held)
    except UNSOLVED:
        uncertain = UncertainWrench(np.zeros(6), np.zeros(6), 0.0)
    asked.say("asking whether the sensors' noise is white")
    try:
        colour = noise_colour(least, windows, asked.floor, sensing_alone(asked, state))
    except UNSOLVED:
        colour = Colour(None, 0.0)
    # With commands as the model states them the search has been already.
    otherwise = kept is None and held.odds > 0.0
    if otherwise or colour.noise is not None:
        why = [f"commands change between samples ({held.name})"] if otherwise else []
        why += [] if colour.noise is None else ["the sensors' noise is not white"]
        asked.say(f"{' and '.join(why)}: searching again")
        # What names cost in free running is worked out with commands that go so, too.
        asked = asked.with_commands(held.path(interval_of(read))) if otherwise else asked
        state = search(asked, colour.applied(windows), until=a_force_stays)
        late = None if colour.noise is not None else late_by_a_share(asked, state, read, held)
        if late is not None:
            gone, held = {**gone, **replaced(late[0], state.current)}, late[1]
            asked = without(asked, gone).with_commands(held.path(interval_of(read)))
            asked.say("commands act later than taken, by part of an interval: searching again")
            state = search(asked, held.applied(read), until=a_force_stays)
        state = state.but(failed={**state.failed, **gone})
    told: dict[str, Any] = {
        "commands": {**held.to_dict(), **({"uncertain": w} if (w := uncertain.to_dict()) else {})},
        "noise": colour.to_dict(),
    }
    if not state.leaves_something:
        return _names_alone(asked, began, state, told, [])
    if state.refuted is not None and not leaves_force(asked, state, state.refuted):
        # With all names nothing significant is left: those that predict alone decide whether there is.
        state = settled(asked, state)
    try:
        ask = partial(beside_names, anew=_with_force) if stand(state, colour) else _with_force
        beside = ask(asked, state, uncertain)
    except UNSOLVED:
        # The first answer stands: it did not need what could not be solved here.
        return _names_alone(asked, began, state, told, [UNDECIDED])
    if beside is None:
        return _names_alone(asked, began, state, told, [])
    state, law, predicted = beside
    return state, {**told, "force": left(law)}, [] if predicted is None else [_words(predicted)]


def _unstated(
    asked: Setting, state: State, stated: StatedCommands
) -> tuple[State, dict[str, Any], list[str]]:
    """Return the answer of a search that knows nothing of the model's statement; that with it where there is none.

    Args:
        asked: what is asked.
        state: where the search by the statement ended.
        stated: how commands go by the model.
    """
    asked.say("commands go otherwise than the model states: searching again")
    anew = replace(asked.with_commands(None), commands=None)
    try:
        begun = search(anew, stated.as_read(state.windows), until=ends_early)
        state, told, words = answer_with_force(anew, begun)
    except UNSOLVED:
        # The answer stands: it did not need what could not be solved here.
        return state, {"commands": stated.law.to_dict()}, []
    return state, {"commands": HELD.to_dict(), **told}, [*words, CONTRADICTED]


def _by_size(state: State) -> list[FittedHypothesis]:
    """Return the explanations that a search has fitted, that which leaves least first."""
    sigma = state.first.fitted.sigma
    return sorted(
        [state.first, *state.tried, state.refuted or state.current], key=lambda e: e.squared_error(sigma)
    )


def _names_alone(
    asked: Setting, began: State, state: State, told: dict[str, Any], words: list[str]
) -> tuple[State, dict[str, Any], list[str]]:
    """Return an answer without a stochastic force: a search that ended early, because a force stays, goes on to its end.

    Args:
        asked: what is asked.
        began: where the first search ended.
        state: where the search stands, perhaps one with other commands or another noise.
        told: what was found of these.
        words: what could not be worked out.
    """
    if not state.interrupted:
        return state, told, words
    whole = search(asked, state.windows)
    if state.windows is began.windows:
        return answer_with_force(asked, whole)
    return whole.but(failed={**whole.failed, **state.failed}), told, words


def _with_fewer_names(asked: Setting, state: State) -> tuple[State, dict[str, Any], list[str]]:
    """Return where the search stands where names leave nothing: without those that only take up what commands do.

    Args:
        asked: what is asked.
        state: where the first search ended.
    """
    found = in_place_of_names(asked, state) if state.chosen else None
    if found is None:
        return state, {}, []
    fewer, law = found
    gone = replaced(fewer, state.current)
    asked.say(f"commands change between samples ({law.name}): searching again")
    try:
        anew = without(asked, gone).with_commands(law.path(interval_of(state.windows)))
        again = search(anew, law.applied(state.windows))
    except UNSOLVED:
        # The first answer stands: it did not need what could not be solved here.
        return state, {}, []
    if again.leaves_something or len(again.chosen) >= len(state.chosen):
        return state, {}, []
    return again.but(failed={**again.failed, **gone}), {"commands": law.to_dict()}, []


def _held(layout: Layout, state: State) -> tuple[FittedHypothesis, Holding]:
    """Return the explanation that leaves least, whatever the search made of it, and how commands go by it.

    One that was tried and is about to diverge says nothing of them: then the next best is asked. The fit without any name
    is asked too: names fitted to such commands as they are have taken up what the commands do to them. It decides where
    the commands have noise and no name stands, and where another law alone explains as much as the names do.
    """
    sigma = state.first.fitted.sigma
    least, held = state.first, HELD
    for end in _by_size(state):
        with suppress(np.linalg.LinAlgError):
            least, held = end, holding(end, state.windows, layout)
            break
    if held.name == "held" and least is not state.first:
        with suppress(np.linalg.LinAlgError):
            plain = holding(state.first, state.windows, layout)
            if plain.name == "averaged" and not state.chosen:
                return least, plain
            alone = cost_with(plain, state.first, state.windows, layout=layout)
            if plain.odds > 0.0 and alone <= cost_at_best(least, state.windows, sigma):
                return state.first, plain
    return least, held


def _with_force(
    asked: Setting, state: State, uncertain: UncertainWrench
) -> tuple[State, ForceLaw | None, InputPrediction | None] | None:
    """Return where a search beside the stochastic force ends, the law, and what measured inputs predict of it.

    None where there is no such force.
    """
    windows, floor, first = state.windows, asked.floor, state.first
    if not leaves_force(asked, state, state.refuted or state.current):
        return None
    alone = fitted_alone(asked, state)
    first, windows = fitted_over_parts(asked, first, windows)
    beside = ForceSearch(asked, windows, closed_loop=uncertain.closed_loop)
    null = beside.begin(first, white(first, floor))
    if null is None:
        return None
    result = beside.run(null, alone, asked.most)
    predicted = result.predicted
    if predicted is not None and not asked.tolerance.strict:
        # What inputs predict has a cause: one that costs little is taken where nothing is predicted beside it.
        beside.names.ignores_cost = beside.looks_further = True
        again = beside.run(null, alone, asked.most)
        if again.predicted is None or goes_further(again, result):
            result, predicted = again, again.predicted
        if predicted is not None and withheld(asked, state, result, chance=False):
            # What takes up a part of what these names leave is looked at before they are not given for that.
            beside.passes_over_none = True
            again = beside.run(null, alone, asked.most)
            if goes_further(again, result):
                result, predicted = again, again.predicted
    over_parts = state.but(first=first, windows=windows)
    ended = state_with(asked, state, over_parts, result, uncertain, chance=predicted is None)
    return ended, result.estimate.law, predicted


def _words(predicted: InputPrediction) -> str:
    return (
        f"{predicted.input} predicts {predicted.share:.0%} of the force in {predicted.axis} that is left "
        f"(at least {predicted.least:.0%}): it is not stochastic, and has no name"
    )
