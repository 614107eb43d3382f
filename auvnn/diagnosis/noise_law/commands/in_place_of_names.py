"""Whether names only take up what commands do between samples.

A name that was fitted to commands as they are logged may stand for nothing but their way from one sample to the next: an
overshoot of the thrust comes earlier than a held command, as the straight line does. Where names leave nothing, no
force is there to ask; so explanations with fewer names are asked whether another law of the commands alone does what the
other names did.

Reference: Akaike (1974), IEEE Transactions on Automatic Control 19(6), for what a further parameter costs.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.holding import cost_at_best, cost_with, fitted_to, holding
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.noise_law.commands.stated import still_stated
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.effects import effect_class
from auvnn.metrics.windows import Windows

# What a further parameter costs, in units of the squared error.
PARAMETER = 2.0
# Share of what names do beyond which it counts that they do more than a law: no law is exact, and they take up the rest.
REST = 0.05
# Hooks of effects that change when a command acts, or how much of it.
OF_COMMANDS = {"command", "delay", "respond", "steer"}
REPLACED = "another law of the commands between samples does what it did"


def in_place_of_names(asked: Setting, state: State) -> tuple[FittedHypothesis, Holding] | None:
    """Return an explanation with fewer names, and a law of the commands with which it does what all do with held ones.

    That with the fewest names is taken; None where there is none.

    Args:
        asked: what is asked.
        state: where a search with held commands has ended, with names.
    """
    end = state.current
    known = {frozenset(e.effects): e for e in (state.first, *state.path) if {*e.effects} < {*end.effects}}
    untimed = without_timed(asked, state, end)
    if untimed is not None:
        known.setdefault(frozenset(untimed.effects), untimed)
    for before in sorted(known.values(), key=lambda e: len(e.effects)):
        law = replaces(before, end, HELD, state.windows, asked.layout)
        if law is not None:
            return before, law
    return None


def kept_as_stated(asked: Setting, state: State, least: FittedHypothesis) -> Holding | None:
    """Return the law of the commands that the model states where a search by it has ended; None where it does not hold.

    Args:
        asked: what is asked, with commands as the model states them.
        state: where the search ended.
        least: the explanation that leaves least.
    """
    if asked.commands is None:
        return None
    if state.leaves_something:
        return still_stated(asked.layout, asked.commands, least, state.windows)
    return None if stand_for_another_law(asked, state) else asked.commands.law


def stand_for_another_law(asked: Setting, state: State) -> bool:
    """Whether names of timing only say that commands go otherwise than the model states: another law does what they did.

    Args:
        asked: what is asked, with commands as the model states them.
        state: where a search with these has ended, with names.
    """
    stated, end = asked.commands, state.current
    before = None if stated is None else without_timed(asked, state, end)
    if stated is None or before is None:
        return False
    read, sigma, sums = stated.as_read(state.windows), end.fitted.sigma, end.fitted.statistics
    least = PARAMETER * (len(end.fitted.theta) - len(before.fitted.theta))
    least *= variance_inflation(sums.slope, sums.total, sums.run)
    with suppress(*UNSOLVED):
        # The explanation was fitted to commands that may be wrong, and is then too far off for the first order about it.
        held = fitted_to(asked.layout, before, read, sigma)
        if replaces(held, end, stated.law, read, asked.layout) is not None:
            return True
        return (
            cost_at_best(held, read, sigma) - cost_with(stated.law, end, read, sigma, asked.layout) <= least
        )
    return False


def replaced(before: FittedHypothesis, end: FittedHypothesis) -> dict[str, str]:
    """Return the names that change when a command acts and that a law has replaced, and why they are not asked for.

    Args:
        before: the explanation that is left.
        end: the explanation with these names.
    """
    return {n: REPLACED for n in timed(end) if n not in before.effects}


def without(asked: Setting, gone: Collection[str]) -> Setting:
    """Return what is asked without some effects."""
    return replace(asked, usable=tuple(n for n in asked.usable if n not in gone))


def timed(explanation: FittedHypothesis) -> list[str]:
    """Return the names that change when a command acts, or how much of it."""
    return [n for n in explanation.effects if OF_COMMANDS & {*effect_class(n).hooks()}]


def without_timed(asked: Setting, state: State, end: FittedHypothesis) -> FittedHypothesis | None:
    """Return an explanation refitted without those names that change when a command acts; None where it has none.

    Args:
        asked: what is asked.
        state: of the search, whose explanations are taken where one is the same.
        end: the explanation.
    """
    gone = timed(end)
    if not gone:
        return None
    left = {*end.effects} - {*gone}
    for known in (state.first, *state.path, *state.tried):
        if {*known.effects} == left:
            return known
    with suppress(*UNSOLVED):
        return asked.chooser(state.windows).without(end, asked.base, gone)
    return None


def replaces(
    before: FittedHypothesis,
    end: FittedHypothesis,
    held: Holding,
    windows: Windows,
    layout: Layout | None = None,
) -> Holding | None:
    """Return the law of the commands with which an explanation does as well as one with more names, or None.

    A law counts as one parameter, and those of the names that it would replace count, too. Names that change when a
    command acts must do more by a twentieth of what they do with held commands.

    Args:
        before: the explanation with fewer names.
        end: that with more.
        held: the law of the commands with that.
        windows: of commands that are held.
        layout: as `holding` takes it.
    """
    sums = end.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    sigma = end.fitted.sigma
    with suppress(*UNSOLVED):
        law = holding(before, windows, layout)
        if law.odds <= 0.0:
            return None
        alone = cost_with(law, before, windows, sigma, layout)
        with_names = cost_with(held, end, windows, sigma, layout)
        spared = len(end.fitted.theta) - len(before.fitted.theta) - (held.odds <= 0.0)
        least = PARAMETER * spared * factor
        if {*end.effects} - {*before.effects} <= {*timed(end)}:
            least = max(least, REST * (cost_at_best(before, windows, sigma) - with_names))
        if alone - with_names <= least:
            return law
    return None
