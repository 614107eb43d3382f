"""Names compared again beside all that were found after them: is each still needed, and do its rivals still do as well?

When a name is sought, causes that are found later are still in the force that is left, and the law of that force is no
more than near the truth. A name may have taken up what a later one explains, and effects that are confused with the best
are kept although they explain less. Beside all names the force has what is left of it: a name without which the log is as
likely, everything else refitted, is needed no longer; an effect that does better in the place of a name takes it; and a
rival that is refitted in the place of the one that leads loses where it falls short by more than any further effect would
still gain, for that is how far the model is known to be wrong.

Reference: Miller (2002), Subset Selection in Regression, 2nd ed., chapter 3 (backward elimination and sequential
replacement); Burnham and Anderson (2002), Model Selection and Multimodel Inference, 2nd ed., chapter 2 (whole models are
compared, not terms).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis, predicts_better
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED, LawFits
from auvnn.diagnosis.noise_law.rounds.leaders import RIVALS
from auvnn.diagnosis.noise_law.rounds.looking_ahead import RIVALS_SHARE
from auvnn.diagnosis.noise_law.rounds.path import with_last
from auvnn.diagnosis.noise_law.rounds.plainer_causes import Change, Refit, nearly_all
from auvnn.diagnosis.selection.model_comparison import ODDS, confused
from auvnn.diagnosis.selection.rivals import Rivals
from auvnn.effects import effect_class
from auvnn.effects.acting_beside import last_names
from auvnn.estimation.priors import parameters_of, set_parameters

Array = NDArray[np.float64]
# Standard errors by which runs left out must be predicted better with the name that leads: where a further effect still
# gains something, so that the model is known to be wrong, and where none does.
SURE, SURE_OF_ALL = 3.0, 2.0
# What the further parameters of a rival gain by chance alone is exceeded as seldom as this.
ALPHA_EXTRA = 0.01
# Logarithm of the odds against each of them where the log tells a tenth of its plausible size (MacKay's Occam factor).
SEEN = float(np.log(10.0))
# Logarithm of the odds by which a fit may fall short, what its next step promises included, before it is given up: where
# a name is needed so much, the fit without it need not be finished.
FAR = 1000.0
# Logarithm of the odds from which a name that costs little stands.
MUCH = 300.0


def refitted(
    layout: Layout,
    fits: LawFits,
    current: Hypothesis,
    base: Sequence[str],
    name: str,
    rival: FittedHypothesis | None,
    *,
    whole: bool = False,
) -> Hypothesis | None:
    """Return the names that were found without one of them, everything else fitted; None where that fails.

    Args:
        layout: stated values.
        fits: under laws of the force.
        current: with the names that were found.
        base: effects that are free whatever is chosen.
        name: that is left out.
        rival: an effect that takes its place, as it was fitted when the two could not be told apart; None for none.
        whole: whether the fit goes on to its end though it falls far short.
    """
    fitted = current.explanation.fitted
    model = fitted.model.rebuilt(fitted.model.copied_effects())
    set_parameters(model, [name], parameters_of(layout.model, [name]))
    effects = [e for e in current.explanation.effects if e != name]
    if rival is not None:
        # What acts beside the rival only comes with it.
        new = [e for e in last_names(rival.effects) if e not in effects]
        effects += new
        set_parameters(model, new, parameters_of(rival.fitted.model, new))
    with suppress(*UNSOLVED):
        least = -np.inf if whole else current.evidence - FAR
        return fits.from_null(layout, model, current, list(base), effects, least, held=False)
    return None


def no_longer_needed(
    names: Iterable[str], current: Hypothesis, refit: Refit
) -> tuple[str, Hypothesis] | None:
    """Return the name that the log needs least, and the explanation without it; None where it needs all.

    Args:
        names: that are asked for.
        current: with all names.
        refit: fits all names but one.
    """
    names = list(names)
    without = zip(names, refit([(name, None) for name in names]), strict=True)
    spare = [(n, h) for n, h in without if h is not None and current.evidence - h.evidence < ODDS]
    return max(spare, key=lambda found: found[1].evidence, default=None)


def costs_little(
    names: Iterable[str], current: Hypothesis, refit: Refit, pays: Callable[[Hypothesis, Hypothesis], bool]
) -> tuple[str, Hypothesis] | None:
    """Return the name that the log needs least of those that cost little, and the explanation without it, or None.

    What is surely there may matter to nobody: clocks that are not exact look like a lag of a hundredth of a second. What
    brings much is left where it is: without it there would be a force that is left.

    Args:
        names: that are asked for.
        current: with all names.
        refit: fits all names but one.
        pays: whether a name costs enough in free running; called with the explanation in which it is the last one, and
            that without it.
    """
    names = list(names)
    without = zip(names, refit([(name, None) for name in names]), strict=True)
    little = [(n, h) for n, h in without if h is not None and current.evidence - h.evidence < MUCH]
    spare = [(n, h) for n, h in little if not pays(replace(current, explanation=with_last(current, n)), h)]
    return max(spare, key=lambda found: found[1].evidence, default=None)


def rivals_among(known: Sequence[Hypothesis], null: Hypothesis) -> Rivals:
    """Return what might take the place of each of some effects, as it was fitted, the most evident first.

    Rivals are effects that the catalogue knows to be confused with one, and that gained half as much as it, or more, when
    the first name was sought.

    Args:
        known: what was fitted then, the most evident first.
        null: without any name.
    """
    gains = {h.name: h.evidence - null.evidence for h in known}
    return {
        name: [
            h.explanation for h in known if gains[h.name] >= RIVALS_SHARE * gain and confused(h.name, name)
        ]
        for name, gain in gains.items()
    }


def as_good_in_place(
    names: Iterable[str], current: Hypothesis, rivals: Rivals, refit: Refit
) -> tuple[str, Hypothesis] | None:
    """Return the best rival that does as well as a name in its place, everything else fitted again, and that name.

    None where none does.

    Args:
        names: whose places are asked for.
        current: with all names.
        rivals: of each name; the first two are fitted.
        refit: fits all names with a rival in the place of one.
    """
    changes: list[Change] = []
    for name in names:
        able = [e for e in rivals.get(name, ()) if e.effects[-1] not in current.explanation.effects]
        changes += [(name, rival) for rival in able[:RIVALS]]
    found = [
        (name, other)
        for (name, _), other in zip(changes, refit(changes), strict=True)
        if other is not None and current.evidence - other.evidence < ODDS
    ]
    return max(found, key=lambda pair: pair[1].evidence, default=None)


def loses(current: Hypothesis, rival: Hypothesis, rest: float, extra: int) -> bool:
    """Whether a rival explains less than the names that were found, by more than the model is known to be wrong.

    A rival that contains what leads predicts as well, whatever the truth. Where it has more parameters, fits as well, and
    gains no more than chance by them, evidence decides: what that counts against the rival is that it could have
    explained much else. Where the log would have seen a tenth of what is plausible of each of them, how far the model is
    wrong does not matter: that would have made them gain more, and not less. One that fits worse does not contain what
    leads, or its fit has not come so far: runs left out decide (the test of Vuong, of models that do not contain each
    other), on weaker grounds where no further effect gains anything: then nothing says that the model is wrong, and the
    odds hold as they are.

    Args:
        current: with the names that were found.
        rival: with the rival in the place of one of them.
        rest: what the best further effect gains beside the names, in the logarithm of the odds.
        extra: parameters that the rival has more than the name in whose place it is; zero where it is the plainer cause.

    Reference: MacKay (2003), Information Theory, Inference and Learning Algorithms, chapter 28 (Occam's razor); Vuong
        (1989), Econometrica 57(2) 307-333.
    """
    ahead = current.evidence - rival.evidence
    if extra > 0 and -2.0 * ODDS < current.misfit - rival.misfit < chi2.isf(ALPHA_EXTRA, extra):
        return ahead > max(ODDS, min(rest, SEEN * extra))
    if ahead <= max(ODDS, rest):
        return False
    return predicts_better(current, rival, SURE if rest > ODDS else SURE_OF_ALL, ranks=False)


def those_that_lose(
    layout: Layout,
    groups: Sequence[Sequence[FittedHypothesis]],
    current: Hypothesis,
    refit: Refit,
    rest: float,
) -> set[tuple[str, str]]:
    """Return the rivals that lose, each as the name of the one that leads and its own.

    Args:
        layout: for the number of an effect's parameters.
        groups: explanations that could not be told apart, the one that leads first.
        current: with the names that were found.
        refit: fits all names with a rival in the place of one.
        rest: what the best further effect gains beside the names, in the logarithm of the odds.
    """
    return {
        (name, rival)
        for name, rival, other in _in_the_lead(groups, refit)
        if loses(current, other, rest, _extra(layout, name, rival))
    }


def that_leads_instead(
    layout: Layout,
    groups: Sequence[Sequence[FittedHypothesis]],
    current: Hypothesis,
    refit: Refit,
    rest: float,
) -> tuple[str, Hypothesis] | None:
    """Return a name that leads a group and loses against a member of it, and the best such member in its place.

    None where each name that leads does as well as all that could not be told from it. The plainer cause leads a group
    whose members explain the trace alike; beside names that were found later it may be clearly worse.

    Args:
        layout: for the number of an effect's parameters.
        groups: explanations that could not be told apart, the one that leads first.
        current: with the names that were found.
        refit: fits all names with a rival in the place of one.
        rest: what the best further effect gains beside the names, in the logarithm of the odds.
    """
    found = [
        (name, other)
        for name, rival, other in _in_the_lead(groups, refit)
        if loses(other, current, rest, _extra(layout, rival, name))
        if name not in effect_class(rival).plainer
        or not nearly_all(other, current, refit([(name, None)])[0], rest)
    ]
    return max(found, key=lambda pair: pair[1].evidence, default=None)


def _in_the_lead(
    groups: Sequence[Sequence[FittedHypothesis]], refit: Refit
) -> list[tuple[str, str, Hypothesis]]:
    """Return each name that leads a group, each of its rivals, and all names with that one in its place, if it fits."""
    pairs = [(lead.effects[-1], rival) for lead, *rivals in groups for rival in rivals]
    refits = zip(pairs, refit(pairs), strict=True)
    return [(name, rival.effects[-1], other) for (name, rival), other in refits if other is not None]


def _extra(layout: Layout, name: str, rival: str) -> int:
    """Return how many parameters a rival has more than a name; zero where it is the plainer cause or has no more."""
    if rival in effect_class(name).plainer:
        return 0
    return max(len(layout.columns[rival]) - len(layout.columns[name]), 0)
