"""The stages of a search, each from one state to the next: fit of the null, one round after the other, groups again.

A round is: score tests of all that remains, refit of the leaders, their comparison, acceptance of the one that explains
best and pays on what is left out, and pruning of what is then no longer needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from auvnn.diagnosis.answers.table import candidate_table, fill_candidate
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.refine_step import refine_step
from auvnn.diagnosis.residuals.autocorrelation import is_autocorrelated
from auvnn.diagnosis.residuals.forces import exerts_less
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.choose import ALPHA, FORM, LITTLE
from auvnn.diagnosis.selection.model_comparison import forms_that_leave
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.effects.acting_beside import in_order, last_names, needed_beside
from auvnn.estimation.prediction_error import FitError
from auvnn.metrics.windows import Windows

# Once something is in the model the question is asked again, and each time chance gets another turn.
ALPHA_NEXT = 0.01
# "Something is missing, but nothing that has a name" is a claim of its own: where no effect pays on runs left
# out, it takes stronger grounds than the test that opened the search.
ALPHA_UNKNOWN = 0.001


def fit_null(asked: Setting, windows: Windows) -> State:
    """Fit what is uncertain alone."""
    asked.say("fitting the uncertain coefficients")
    first = fit_hypothesis(asked.layout, windows, asked.base, ())
    first, windows = _finer(asked, first, windows)
    return State(windows, first, first)


def search_round(
    asked: Setting, state: State, promising: Callable[[State, Mapping[str, Score]], bool] | None = None
) -> State:
    """Test all effects that remain, refit the leaders, take the one that explains best; see the module's text.

    Args:
        asked: what is asked.
        state: where the search stands.
        promising: from this and the tests, whether fits may be worth their time; where they are not, the state comes
            back as it is.
    """
    chosen, first = list(state.chosen), state.first
    # What could not be told from a name may be missing beside it: then it is no rival.
    remaining = [n for n in asked.usable if n not in {*chosen, *state.withdrawn}]
    asked.say(f"testing {len(remaining)} effects at the null")
    base = [*asked.base, *[c for c in chosen if c not in asked.base]]
    tested = asked.tests(state.windows)(state.current, remaining, base, chosen, alike=not state.table)
    p_value = tested.p_value
    if promising is not None and not promising(state, tested.scores):
        return state
    if not state.table:
        similar = (remaining, tested.alike)
        beside = asked.model.effect_names
        state = state.but(
            p_value=p_value,
            similar=similar,
            table=candidate_table(asked.layout, tested.scores, state.current, similar, dict(asked.needs)),
            silent=tuple(n for n in remaining if not (tested.scores[n].degrees or needed_beside(n, beside))),
        )
    if p_value >= (ALPHA_NEXT if chosen else ALPHA) or not remaining or len(chosen) >= asked.most:
        ended = state.step(rest(asked, state.current), [], p_value)
        return ended.but(ended=True, last_tests=(state.current, tested))
    chooser = asked.chooser(state.windows)
    places = asked.most - len(chosen)
    choice = chooser.choose(tested.scores, tested.at, base, chosen, state.current, places)
    others = tested.scores
    while passed := _what_others_leave(asked, state, choice.best):
        others = {n: s for n, s in others.items() if n not in passed}
        choice = chooser.choose(others, tested.at, base, chosen, state.current, places)
    state = state.but(failed={**state.failed, **choice.failed}, tried=(*state.tried, *choice.tried))
    if not chosen:
        for explanation in choice.tried:
            state = state.but(table=fill_candidate(asked.layout, state.table, explanation, first))
    if choice.best is None:
        verdict = "unknown" if p_value < ALPHA_UNKNOWN else rest(asked, state.current)
        return state.step(verdict, [], p_value).but(ended=True, last_tests=(state.current, tested))
    new = in_order([e for e in choice.best.effects if e not in chosen])
    alike = {e.effects[-1]: group[0].effects[-1] for group in state.groups for e in group[1:]}
    for name in new:
        state = state.apart(name)
    verdict, rivals = choice.verdict, [e for e in choice.rivals if e.effects[-1] not in state.rivals]
    if verdict == "ambiguous":
        new = [e.effects[-1] for e in rivals]
        verdict = "ambiguous" if len(rivals) > 1 else "named"
        state = state.but(groups=(*state.groups, tuple(rivals)) if len(rivals) > 1 else state.groups)
    state = state.step(verdict, new, p_value)
    # What acts beside the one that is taken only is no rival of the others: it has a step of its own.
    if beside := [e for e in last_names(choice.best.effects) if e not in (*chosen, *new)]:
        state = state.step("named", beside, p_value)
    current, gone = choice.best, []
    if chosen:
        current, gone = chooser.withdrawn(choice.best, asked.base)
    if gone:
        state, gone = state.without_groups(gone)
        state = state.but(withdrawn=(*state.withdrawn, *gone))
        for name, lead in ((n, alike[n]) for n in new if alike.get(n) in gone):
            # It was the other one of those that could not be told apart.
            state = state.instead(lead, name)
            gone.remove(lead)
        state = state.step("withdrawn", gone, p_value) if gone else state
    chosen = current.effects
    current, windows = _finer(asked, current, state.windows)
    tried = (*state.tried, current)
    path = (*state.path, current)
    return state.but(current=current, windows=windows, chosen=tuple(chosen), tried=tried, path=path)


def _what_others_leave(asked: Setting, state: State, further: FittedHypothesis | None) -> list[str]:
    """Return further effects that are known to look like what the form of an earlier one gets wrong, and are no more.

    Such an effect exerts less than those do whose form is in question; or explains little beside the earlier ones, and
    exerts less than twice that: what a form gets wrong is not many times what the effect itself does.

    Args:
        asked: for what the model states of its effects.
        state: with the names before them.
        further: the explanation with them; None where there is none.
    """
    new = [] if further is None else [n for n in further.effects if n not in state.chosen]
    forms = {n: of for n in new if (of := forms_that_leave(n, state.chosen))}
    if further is None or not forms:
        return []
    explanations = state.first, state.current, further
    first, current, after = (e.squared_error(state.first.fitted.sigma) for e in explanations)
    little = current - after < LITTLE * (first - current) / len(state.chosen)
    times = FORM if little else 1.0
    return [n for n, of in forms.items() if exerts_less(further, state.windows, n, of, asked.stated, times)]


def regroup(asked: Setting, state: State) -> State:
    """Look at each group again beside what was found after it, and take what is to be taken then.

    The errors of what had not been found yet may have hidden the difference.
    """
    chooser, last = asked.chooser(state.windows), state.current
    groups, steps = list(state.groups), [s.copy() for s in state.steps]
    for k, group in enumerate(state.groups):
        names = [e.effects[-1] for e in group]
        if {*last.effects} == {*group[0].effects}:
            continue
        asked.say(f"asking again which of {', '.join(names)} it is")
        left = chooser.regrouped(last, asked.base, group)
        last, groups[k] = left[0], tuple(left)
        if last.effects[-1] != names[0]:
            # What stopped the search was said of another member.
            steps[-1]["verdict"] = rest(asked, last)
        step = next(s for s in steps if s["effects"] == names)
        step["effects"] = [e.effects[-1] for e in left]
        if len(left) == 1:
            step["verdict"] = "named"
    open_ = tuple(group for group in groups if len(group) > 1)
    return state.but(current=last, groups=open_, steps=tuple(steps))


def rest(asked: Setting, current: FittedHypothesis) -> str:
    """Return the verdict where no effect is asked for any more."""
    return "unknown" if is_autocorrelated(current, asked.floor) else "adequate"


def _finer(asked: Setting, found: FittedHypothesis, windows: Windows) -> tuple[FittedHypothesis, Windows]:
    """Return a fit with steps so short that what the integrator gets wrong has no say in what follows."""
    shorter = refine_step(found.fitted.model, windows, found.fitted.initial, found.fitted.sigma)
    if shorter is windows:
        return found, windows
    asked.say("fitting again with shorter steps")
    guess = replace(asked.layout, model=found.fitted.model)
    try:
        again = fit_hypothesis(
            asked.layout, shorter, asked.base, found.effects, start=found.fitted, guess=guess
        )
    except FitError:
        return found, windows
    return again, shorter
