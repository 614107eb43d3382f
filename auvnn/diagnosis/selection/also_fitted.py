"""Which effects are fitted besides those that lead by their tests: what may refute these, what is confused with them."""

from __future__ import annotations

from collections.abc import Sequence

from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.model_comparison import ALPHA_NEEDED, confused
from auvnn.effects import effect_class

# Where the errors fall by so many times what the slopes at the null promised, or by so small a share of it, these do not
# rank the effects; so many of those that are known to be confused with the best one are fitted too, and, wherever it
# falls, so many of the plainer causes that it contains.
BENT, RIVALS = 1.5, 2


def promising(significant: Sequence[Score], leading: Sequence[Score]) -> list[Score]:
    """Return the test, if any, of the effect that might refute those in the lead by its better fit.

    Args:
        significant: tests of effects that are.
        leading: those of them that lead by evidence, the first of all first.
    """
    if not leading:
        return []
    most = leading[0].gain
    more = [s for s in significant if s not in leading and s.gain - most > chi2.isf(ALPHA_NEEDED, s.degrees)]
    return sorted(more, key=lambda s: s.degrees - s.gain)[:1]


def rivals_to_fit(
    tried: Sequence[FittedHypothesis], significant: Sequence[Score], current: FittedHypothesis
) -> list[Score]:
    """Return tests of effects that are confused with the best of those that were fitted, and were not.

    A large effect is not where its slope at the null points. A lag of seconds has a hundredth of the evidence there that
    an overshoot has, of which it is a special case, and explains as much once both are fitted. An effect of many
    parameters has more evidence than a plainer cause that it imitates, even where slopes say all: six factors of the
    added mass take up one mass that is missing. So the plainer causes of the best one are fitted in any case.

    Args:
        tried: explanations that were fitted.
        significant: tests of effects that are.
        current: the explanation without any of them.
    """
    if not tried:
        return []
    promised = {s.effect: s.gain for s in significant}
    best = min(tried, key=lambda e: e.fitted.cost)
    name = best.effects[-1]
    fell = current.fitted.cost - best.fitted.cost
    known = {e.effects[-1] for e in tried}
    more = [s for s in significant if s.effect not in known and confused(name, s.effect)]
    more.sort(key=lambda s: -s.evidence)
    plainer = [s for s in more if s.effect in effect_class(name).plainer][:RIVALS]
    if promised[name] / BENT <= fell <= promised[name] * BENT:
        return plainer
    return plainer + [s for s in more if s not in plainer][:RIVALS]
