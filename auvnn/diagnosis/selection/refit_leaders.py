"""The leading effects of a round, each refitted beside what was found: none has to wait for another.

What moves the water is refitted a second time, together with how much of that the drag alone feels: in a simulator that
puts the current into the drag alone, a current that all terms feel explains next to nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis, log_evidence
from auvnn.diagnosis.hypotheses.stated_priors import Layout, initial_guess, shapes
from auvnn.diagnosis.hypotheses.within_record import within_record
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.acting_together import begin_beside, comes_with
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.executors import Executor
from auvnn.metrics.windows import Windows

# Parts of what a test estimates from which a fit is begun, the next where the one before diverged: near the
# bottom the force grows faster than any slope says.
SHARES = (1.0, 0.1)


@dataclass(frozen=True)
class Beside:
    """What effects are fitted beside.

    Attributes:
        layout: stated values.
        windows: of the log.
        at: the layout at the current fit.
        base: effects that are free anyway.
        chosen: effects found before.
        current: the fit without any of those that remain.
        open_to: effects that may be named.
    """

    layout: Layout
    windows: Windows
    at: Layout
    base: list[str]
    chosen: list[str]
    current: FittedHypothesis
    open_to: Sequence[str] = ()


def fitted_beside(
    beside: Beside, candidates: Sequence[Score], pool: Executor, say: Callable[[str], None]
) -> tuple[list[FittedHypothesis], dict[str, str]]:
    """Return effects, each fitted beside what was found, and of those that could not be why.

    Args:
        beside: what was found.
        candidates: tests of the effects.
        pool: who makes the fits.
        say: called with what is being done, in words.
    """
    tried, failed = list[FittedHypothesis](), dict[str, str]()
    fitted = pool.run(_fitted, beside, candidates)
    for candidate in candidates:
        say(f"fitting {candidate.effect}")
        found = next(fitted)
        if isinstance(found, str):
            failed[candidate.effect] = f"its fit failed: {found}"
        elif not within_record(found, beside.windows):
            failed[candidate.effect] = "its fit begins before the log does, or after its end"
        else:
            tried.append(found)
    return tried, failed


def _fitted(beside: Beside, candidate: Score) -> FittedHypothesis | str:
    """Return an effect fitted, or why it could not be: a task of an executor."""
    found: FittedHypothesis | str
    try:
        found = refitted(beside, candidate)
    except (FitError, np.linalg.LinAlgError) as problem:
        found = str(problem)
    for other in comes_with(candidate.effect, beside.chosen, beside.open_to, beside.base):
        with suppress(FitError, np.linalg.LinAlgError):
            pair = refitted(beside, candidate, other)
            found = pair if isinstance(found, str) else _likelier(beside.layout, found, pair)
    return found


def _likelier(layout: Layout, alone: FittedHypothesis, pair: FittedHypothesis) -> FittedHypothesis:
    """Return two effects for one where they are likelier by as much as a name needs."""
    sums = [e.fitted.statistics for e in (alone, pair)]
    factor = min(variance_inflation(s.slope, s.total, s.run) for s in sums)
    gain = log_evidence(layout, pair, factor).evidence - log_evidence(layout, alone, factor).evidence
    return pair if gain > ODDS else alone


def refitted(beside: Beside, candidate: Score, other: str | None = None) -> FittedHypothesis:
    """Return an effect fitted beside what was found, from where its test points.

    Args:
        beside: what was found.
        candidate: its test.
        other: an effect that acts beside it only, and is fitted with it; from the null of the former, for what its test
            says holds for it alone.

    Raises:
        FitError: it has nowhere to begin.
    """
    name, at, current = candidate.effect, beside.at, beside.current
    guess = at.model.rebuilt(at.model.copied_effects())
    known = parameters_of(at.model, [name])
    start, shape = initial_guess(beside.layout, name, candidate.estimate), shapes(beside.layout, name)
    found: FittedHypothesis | None = None
    problem: FitError | None = None
    together = [] if other is None else [other]
    for effect in together:
        set_parameters(guess, [effect], begin_beside(beside.layout, effect))
    for share in SHARES if other is None else (0.0,):
        begin = np.where(shape, start, known + share * (start - known))
        set_parameters(guess, [name], begin)
        try:
            found = fit_hypothesis(
                beside.layout,
                beside.windows,
                beside.base,
                [*beside.chosen, *together, name],
                start=current.fitted,
                guess=replace(at, model=guess),
                sigma=current.fitted.sigma,
                iterations=6,
            )
        except FitError as fault:
            problem = fault
            continue
        # It holds the fit without the effect: one that is worse than that has diverged.
        if found.fitted.cost <= current.fitted.cost:
            break
    if found is None:
        raise problem or FitError(f"{name} has nowhere to begin")
    return found
