"""Effects that do nothing by themselves, fitted together with one beside which they act.

A simulator may put the current into the drag alone. A model in which fins and added mass feel the current too fits such
a log only without a current: the test for one promises nothing, and its fit ends at zero. How much of the current only
the drag feels (`drag_only_current`) has no test either as long as the model has no current. So the two are fitted
together, and named together where they are likelier than the current alone by the odds of a name. These fits take time.
They are made where nothing is named yet and the current is fitted anyway, and where a name was found that the catalogue
knows to be confused with the effect that cannot act alone: the Coriolis forces of the added mass, which the same
simulators leave out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout, shapes
from auvnn.diagnosis.selection.model_comparison import confused
from auvnn.effects import EFFECTS, effect_class
from auvnn.effects.acting_beside import needed_beside


def comes_with(
    name: str, chosen: Sequence[str], open_to: Iterable[str], there: Iterable[str] = ()
) -> list[str]:
    """Return the effects that are worth fitting together with one.

    Args:
        name: of the effect beside which they would act.
        chosen: names found before.
        open_to: effects that may be named.
        there: effects that the model has, beside these names.
    """
    names = {*open_to}
    acting = [n for n in EFFECTS.names() if n in names and name in effect_class(n).acts_with]
    if chosen:
        acting = [n for n in acting if any(confused(n, c) for c in chosen)]
    # Where one of those beside which it acts was found, its own test says whether it is missing.
    return [n for n in acting if needed_beside(n, (*chosen, *there))]


def worth_fitting_together(
    layout: Layout, chosen: Sequence[str], open_to: Iterable[str], there: Iterable[str] = ()
) -> list[str]:
    """Return the effects to fit whatever their tests promise, because another one may act beside them.

    Args:
        layout: for what the effects' parameters are; one with a shape of its own is sought by its test alone.
        chosen: names found before.
        open_to: effects that may be named.
        there: effects that the model has, beside these names.
    """
    names, present = list(open_to) if chosen else [], list(there)
    return [n for n in names if comes_with(n, chosen, names, present) and not shapes(layout, n).any()]


def begin_beside(layout: Layout, name: str) -> NDArray[np.float64]:
    """Return values from which to fit an effect beside one with which it acts, (p,): two scales away from the null.

    Of a share that is all of it. Begun from a half, the other half hides the effect beside which it acts, and the fit
    ends without either.

    Args:
        layout: for what the effect's parameters are.
        name: of the effect.
    """
    return np.array([min(p.null + 2.0 * p.scale, p.high) for p in layout.described(name)])


def named_with(effects: Sequence[str], chosen: Sequence[str]) -> list[str]:
    """Return the names that come with the last effect of an explanation.

    Args:
        effects: of the explanation.
        chosen: names that were found before, the last effect among them.
    """
    return [n for n in effects if n not in chosen]
