"""How far effects that have no name would move what was found.

A search ends with names beside which the log is likelier with further effects that cost too little to be named, or that
come after the largest number of names. The values of the names are what they are without them: where a drag has another
exponent, the lift beside it takes up a part of it, by many times what the noise would move it. The effects that the
tests find are therefore put in, linearised, one after the other as long as the log asks for one more; what all of them
together move, and what they leave open, is part of the standard errors.

Reference: White (1982), Econometrica 50(1) 1-25, for what an incomplete model estimates; Draper (1995), Journal of the
Royal Statistical Society B 57(1) 45-97, for what the choice of a model leaves out of its intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, priors, scales
from auvnn.diagnosis.score_tests.null_tests import Tested
from auvnn.diagnosis.score_tests.probes import Probed, extent_of, narrowed, probed
from auvnn.diagnosis.score_tests.score import Score, score
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import parameters_of
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# At most so many effects are asked for together, those that lead by their tests.
MOST = 8


@dataclass(frozen=True)
class Moved:
    """How far parameters may be off because of effects without a name.

    Attributes:
        effects: that the log asks for together, the likeliest first.
        by: in each parameter of the fit, (P,); zero where there are none.
    """

    effects: tuple[str, ...]
    by: Array


def moved_by_unnamed(
    windows: Windows, current: FittedHypothesis, tested: Tested, base: Sequence[str]
) -> Moved:
    """Return which effects without a name the log asks for beside a fit, and how far they may move its parameters.

    Args:
        windows: of the log, with the law of a stochastic force where there is one.
        current: the fit with the names, weighed as its sums under that law are.
        tested: the tests of the other effects beside them.
        base: effects that are free, the names among them.
    """
    out = np.zeros(len(current.fitted.theta))
    likely = [s for n, s in tested.scores.items() if s.degrees and s.evidence > ODDS and n not in base]
    likely = sorted(likely, key=lambda s: -s.evidence)[:MOST]
    if not likely:
        return Moved((), out)
    asked = _with_shapes(tested.at, windows, likely, base)
    sums = asked.sums(windows, current)
    joined = likely_together(asked, sums, base, [s.effect for s in likely], current.effects)
    if not joined:
        return Moved((), out)
    moved = moved_together(asked.layout, sums, base, joined, current.effects)
    at, theirs = tested.at.places(current.names), tested.at.places(base)
    for name in {*at} & {*theirs}:
        out[at[name]] = moved[theirs[name]]
    return Moved(tuple(label.partition("@")[0] for label in joined), out)


def widened(explanation: FittedHypothesis, moved: Moved) -> FittedHypothesis:
    """Return an explanation with what effects without a name would move as a part of its standard errors.

    What lies between it and explanations with one name more is known of some: the larger of both counts.

    Args:
        explanation: a fit.
        moved: from `moved_by_unnamed`.
    """
    if not moved.effects:
        return explanation
    known = 0.0 if explanation.systematic is None else explanation.systematic
    return replace(explanation, systematic=np.maximum(known, moved.by), beside=moved.effects)


def likely_together(
    asked: Probed, sums: Statistics, base: Sequence[str], names: Sequence[str], free: Sequence[str]
) -> list[str]:
    """Return which effects the log asks for beside one another, by the labels that the layout has for them.

    Args:
        asked: the layout with the effects at one shape each.
        sums: of the windows, products of all columns in them.
        base: effects that are free.
        names: effects to ask for.
        free: effects of the base whose priors are wide.
    """
    joined, rest = list[str](), [label for name in names for label in asked.labels(name)]
    while rest:
        tests = {
            label: score(sums, asked.layout, [*base, *joined], label, [*free, *joined]) for label in rest
        }
        best = max(rest, key=lambda label: tests[label].evidence)
        if tests[best].evidence <= ODDS:
            break
        joined.append(best)
        rest.remove(best)
    return joined


def _with_shapes(layout: Layout, windows: Windows, likely: Sequence[Score], base: Sequence[str]) -> Probed:
    """Return the layout with nothing but the base and the likely effects, each held at the shape that its test found."""
    names, shapes = [s.effect for s in likely], {}
    for found in likely:
        described = layout.described(found.effect)
        held = {p.name: float(v) for p, v in zip(described, found.estimate, strict=True) if p.shape}
        if held:
            shapes[found.effect] = [held]
    kept = [e for e in layout.model.copied_effects() if str(e.name) in (*base, *names)]
    return probed(narrowed(layout, layout.model.rebuilt(kept)), names, extent_of(windows), shapes_of=shapes)


def moved_together(
    layout: Layout, sums: Statistics, base: Sequence[str], joined: Sequence[str], free: Sequence[str]
) -> Array:
    """Return how far the base goes where further effects are put in, and how much less is known of it then, together.

    Args:
        layout: which columns belong to which effect, at the fit without the further effects.
        sums: of the windows there, products of all columns in them.
        base: effects that are free in the fit.
        joined: further effects, each of plausible size, by the labels that the layout has for them.
        free: effects of the base whose priors are wide.

    Returns:
        (P,), parameters in the order of the base.
    """
    f, c = layout.of(base), layout.of(joined)
    held, theta = priors(layout, base, free), parameters_of(layout.model, base)
    movable = held.inside(theta)
    inside, both = f[movable], np.concatenate([f[movable], c])
    plausible = np.concatenate([scales(layout, label) for label in joined])
    known = np.asarray(block_diag(held.square[np.ix_(movable, movable)], np.diag(plausible**-2.0)))
    pull = np.concatenate([held.pull(theta)[movable], np.zeros(len(c))])
    whole = NormalEquations(sums.total[np.ix_(both, both)] + known, sums.slope.sum(0)[both] - pull)
    size = np.arange(len(inside))
    alone = whole.part(size)
    step = whole.solve()[size] - alone.solve()
    open_ = np.diag(whole.covariance())[size] - np.diag(alone.covariance())
    out = np.zeros(len(f))
    out[movable] = np.sqrt(step**2 + np.maximum(open_, 0.0))
    return out
