"""With which name to begin, where several explain about as much: pairs of names are compared, not first names alone.

Where two effects are missing, a third one that explains a part of both may explain more than either alone; whoever
takes one name after the other begins with it and has to go on from there. So the leading first names are followed one
round further, and what the likeliest pairs have in common comes first.

Reference: Miller (2002), Subset Selection in Regression, 2nd ed., section 3 (forward selection misses the best pair).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from auvnn.diagnosis.noise_law.hypothesis import CLOSE, Hypothesis
from auvnn.diagnosis.selection.model_comparison import ODDS, confused

# Names are followed that gain such a share of what the first one gains, and so many of them.
RIVALS_SHARE, BRANCHES = 0.5, 3


@dataclass(frozen=True)
class Branch:
    """A first name and what may come after it.

    Attributes:
        first: the name, as it was judged among all.
        after: the same, settled: what further names are sought beside.
        further: explanations with one name more that are likely, whatever they cost, the most evident first.
    """

    first: Hypothesis
    after: Hypothesis
    further: Sequence[Hypothesis] = ()

    @property
    def evidence(self) -> float:
        """Of the likeliest explanation that begins with the name."""
        return max(h.evidence for h in (self.after, *self.further))


def worth_following(good: Sequence[Hypothesis], before: Hypothesis) -> list[Hypothesis]:
    """Return the names that explain about as much as the first one, that one first.

    Args:
        good: names that may be given, the most evident first.
        before: the explanation without any.
    """
    least = RIVALS_SHARE * (good[0].evidence - before.evidence)
    return [h for h in good if h.evidence - before.evidence >= least][:BRANCHES]


def decided(good: Sequence[Hypothesis], branches: Sequence[Branch], before: Hypothesis) -> list[Hypothesis]:
    """Return the first names that may be given once pairs are compared, the one to begin with first.

    Args:
        good: names that may be given, the most evident first.
        branches: those of them that were followed.
        before: the explanation without any.
    """
    sets: dict[frozenset[str], float] = {}
    for branch in branches:
        for h in (branch.after, *branch.further):
            names = frozenset(h.explanation.effects)
            sets[names] = max(sets.get(names, h.evidence), h.evidence)
    top = max(sets.values())
    # As between effects that are confused: the law is no more than near the truth, by a share of what is explained.
    spare = max(ODDS, CLOSE * (top - before.evidence))
    near = [names for names, evidence in sets.items() if top - evidence < spare]
    common, any_of = frozenset.intersection(*near), frozenset.union(*near)
    followed = {b.first.name for b in branches}
    certain = [b.first for b in branches if b.first.name in common]
    if certain:
        first = max(certain, key=lambda h: h.evidence)
        return [first, *[h for h in good if h.name not in followed and confused(first.name, h.name)]]
    return [h for h in good if h.name not in followed or h.name in any_of]


def shared(branches: Sequence[Branch]) -> list[tuple[Branch, Hypothesis]]:
    """Return pairs that were found from their other name, each with the branch in which it may be a further name too.

    Args:
        branches: first names with what may come after each.
    """
    out = []
    for here in branches:
        for there in branches:
            for h in there.further:
                if there is not here and h.name == here.first.name and len(h.explanation.effects) == 2:
                    effects = (here.first.name, there.first.name)
                    out.append((here, replace(h, explanation=replace(h.explanation, effects=effects))))
    return out
