"""A plainer cause that explains nearly all of what a name does, where the model is known to be wrong.

What the model gets wrong is taken up by whatever has most parameters: a constant force in all degrees of freedom explains
what a missing buoyancy does, and the mean of every other error, and is ahead by any odds. Where some further effect
still gains something beside all names, the plainer cause is therefore told with the name, and first.

Reference: Box (1976), Journal of the American Statistical Association 71(356), section 2.3 (parsimony where all models
are wrong).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.selection.rivals import Rivals
from auvnn.effects import effect_class

# Share of what a name explains by which a plainer cause in its place may fall short.
NEARLY = 0.01
# A name, and a rival that is to take its place, or None.
Change = tuple[str, FittedHypothesis | None]
# Returns of each change the fit of all names with it, None where that fails; no fit has to wait for another.
Refit = Callable[[Sequence[Change]], Sequence[Hypothesis | None]]


def nearly_all(whole: Hypothesis, plainer: Hypothesis, without: Hypothesis | None, rest: float) -> bool:
    """Whether a plainer cause explains all of what a name does but a hundredth, where the model is known to be wrong.

    A constant force in all degrees of freedom takes up what a buoyancy explains, and a mean of whatever else is missing.
    How much that is worth grows with how far the model is wrong, of which no more is known than that it is.

    Args:
        whole: with the name.
        plainer: with the plainer cause in its place.
        without: with neither; None where that cannot be fitted.
        rest: what the best further effect gains beside the names, in the logarithm of the odds.
    """
    if rest <= ODDS or without is None:
        return False
    return whole.evidence - plainer.evidence < NEARLY * (whole.evidence - without.evidence)


def plainer_rivals(names: Iterable[str], current: Hypothesis, rivals: Rivals) -> list[Change]:
    """Return each name with each plainer cause that may take its place.

    Args:
        names: whose places are asked for.
        current: with all names.
        rivals: of each name.
    """
    known = current.explanation.effects
    return [
        (name, e)
        for name in names
        for e in rivals.get(name, ())
        if e.effects[-1] in effect_class(name).plainer and e.effects[-1] not in known
    ]


def nearly_in_place(
    changes: Sequence[Change], current: Hypothesis, refit: Refit, rest: float
) -> tuple[str, Hypothesis] | None:
    """Return the best plainer cause that explains nearly all of what a name does, and that name; None without one.

    Args:
        changes: names, each with a plainer cause that may take its place.
        current: with all names.
        refit: fits all names without one, or with a rival in its place.
        rest: what the best further effect gains beside the names, in the logarithm of the odds.
    """
    if rest <= ODDS:
        return None
    found = [
        (name, other)
        for (name, _), other in zip(changes, refit(changes), strict=True)
        if other is not None and nearly_all(current, other, refit([(name, None)])[0], rest)
    ]
    return max(found, key=lambda pair: pair[1].evidence, default=None)
