"""Effects that do nothing by themselves, fitted together with one beside which they act.

A log of a simulator that puts the current into the drag alone hardly shows it as a current that all terms feel: where
fins feel the water, too, such a current takes them along. Neither its slope nor its own fit leads there, and a share of
which the drag feels more says nothing before water moves. The two are fitted together, and named together where that is
likelier than the one alone by the odds of a name. Fits take time: it is done where a name was found that the catalogue
knows to be confused with the one that cannot act alone (Coriolis forces of the added mass that are missing, which the
same simulators leave out).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout, shapes
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.selection.model_comparison import confused
from auvnn.effects import EFFECTS, effect_class


def comes_with(name: str, chosen: Sequence[str], open_to: Iterable[str]) -> list[str]:
    """Return the effects that are worth fitting together with one.

    Args:
        name: of the effect beside which they would act.
        chosen: names found before.
        open_to: effects that may be named.
    """
    names = {*open_to}
    acting = [n for n in EFFECTS.names() if n in names and name in effect_class(n).acts_with]
    acting = [n for n in acting if any(confused(n, c) for c in chosen)]
    # Where one of those beside which it acts was found, its own test says whether it is missing.
    return [n for n in acting if not {*effect_class(n).acts_with} & {*chosen}]


def worth_fitting_together(layout: Layout, chosen: Sequence[str], open_to: Iterable[str]) -> list[str]:
    """Return the effects to fit whatever their tests promise, because another one may act beside them.

    Args:
        layout: for what the effects' parameters are; one with a shape of its own is sought by its test alone.
        chosen: names found before.
        open_to: effects that may be named.
    """
    names = list(open_to)
    return [n for n in names if comes_with(n, chosen, names) and not shapes(layout, n).any()]


def begin_beside(layout: Layout, name: str) -> NDArray[np.float64]:
    """Return values from which to fit an effect beside one with which it acts: two scales away from the null, (p,).

    Args:
        layout: for what the effect's parameters are.
        name: of the effect.
    """
    return np.array([min(p.null + 2.0 * p.scale, p.high) for p in layout.described(name)])


def named_with(found: Hypothesis, chosen: Sequence[str]) -> list[str]:
    """Return the names that come with the last effect of an explanation.

    Args:
        found: the explanation.
        chosen: names that were found before, the last effect among them.
    """
    return [n for n in found.explanation.effects if n not in chosen]
