"""What all of a long log says: the tests of the leading effects and the fit of what was found, by sums over parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import ByEffect
from auvnn.diagnosis.answers.describe_parameters import describe_parameters
from auvnn.diagnosis.full_data.map_reduce import LinearisationPoint, MapReduce
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.standard_errors import is_possible
from auvnn.diagnosis.hypotheses.stated_priors import DETERMINED, Layout
from auvnn.diagnosis.residuals.autocorrelation import slower_than_white
from auvnn.diagnosis.score_tests.few_windows import are_few
from auvnn.diagnosis.score_tests.probes import Probed
from auvnn.diagnosis.score_tests.score import Score, following, projection, score_from_sums
from auvnn.diagnosis.score_tests.variance_inflation import inflation, inverse_root, ratio, share_left
from auvnn.effects import Extent
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import Priors, limits, parameters_of, set_parameters
from auvnn.estimation.window_sums.sufficient_statistics import Combination, InformationShares, WindowSums
from auvnn.log_chunks.scan import WindowCut

Array = NDArray[np.float64]
# The scores' spread, (p, p), and the share of white noise's that is left in it; None where there are many windows.
_Spread = tuple[Array, float | None]
# Steps of the fit on everything; it begins where the fit on the sample has ended, and ends when a step would change the
# weighted squared error by less than `ENOUGH`.
STEPS, ENOUGH = 4, 0.05


@dataclass(frozen=True)
class ScoreTests:
    """Tests at the null over all windows.

    Attributes:
        scores: effect to its test.
        sums: at the null, towards all parameters.
    """

    scores: dict[str, Score]
    sums: WindowSums


def score_tests(
    passes: MapReduce, point: LinearisationPoint, base: Sequence[str], asked: Sequence[str]
) -> ScoreTests:
    """Test effects at the null over all windows: a pass for the gradients, another one for their variance.

    The null need not be the best fit of the uncertain coefficients on everything: what they could still take is
    taken out to first order, as in `score.project`.

    Args:
        passes: over the parts.
        point: the null; all columns of its layout.
        base: effects that are free anyway.
        asked: effects to test.
    """
    sums = passes.sums(point, "testing at the null")
    held = point.probed
    first = {n: [_accept(held, sums, base, label, None) for label in held.labels(n)] for n in asked}
    wanted = [t for tests in first.values() for t in tests if t.combination is not None]
    asked_of = [c for t in wanted for c in (t.combination, t.shares) if c is not None]
    moments = iter(passes.moments(point, asked_of, "how much the scores vary"))
    known: dict[str, _Spread] = {}
    for t in wanted:
        spread = next(moments).spread()
        known[t.label] = (
            spread,
            None if t.shares is None else share_left(next(moments), t.shares.root.shape[1]),
        )
    scores = {
        n: held.best(n, lambda label: _accept(held, sums, base, label, known.get(label)).score)[0]
        for n in asked
    }
    return ScoreTests(scores, sums)


@dataclass(frozen=True)
class _Test:
    label: str
    score: Score
    combination: Combination | None
    shares: InformationShares | None


def _accept(held: Probed, sums: WindowSums, base: Sequence[str], label: str, known: _Spread | None) -> _Test:
    """Test one effect; without the scores' spread, say of what it is wanted."""
    found = projection(sums.hessian, sums.slope, held.layout, base, label)
    wanted: list[tuple[Combination, InformationShares | None]] = []

    def factor(step: Array, spent: int) -> float:
        if known is not None:
            return inflation(known[0], found.information, sums.windows, spent, known[1])
        size, own = len(sums.slope), np.eye(len(found.own))
        c, f, carry = following(sums.hessian, held.layout, base, label)
        scores, moved, along = np.zeros((len(own), size)), np.zeros((len(own), size)), np.zeros(size)
        scores[:, found.own], scores[:, found.others] = own, -found.carry
        moved[:, c], moved[:, f] = own, -carry
        along[c], along[f] = step, -carry.T @ step
        few = are_few(sums.windows, spent)
        shares = InformationShares(moved, inverse_root(found.information)) if few else None
        wanted.append((Combination(scores, moved, along), shares))
        return 1.0

    score = score_from_sums(held.layout, label, found.gradient, found.information, factor, sums.windows)
    return _Test(label, score, *(wanted[0] if wanted else (None, None)))


@dataclass(frozen=True)
class Refit:
    """What was found, fitted to all windows.

    Attributes:
        names: effects in the order of their columns.
        theta: (P,).
        std: (P,) standard errors, inflated; NaN where the log says no more than what was stated.
        sums: at the fit.
        steps: that it took.
        settled: whether the last of them was negligible.
        lasting: whether the errors that it leaves are slower than white noise.
    """

    names: tuple[str, ...]
    theta: Array
    std: Array
    sums: WindowSums
    steps: int
    settled: bool
    lasting: bool

    def values(self, layout: Layout, wanted: Sequence[str]) -> ByEffect:
        """Return the named effects' parameters with their standard errors, as answers hold them."""
        places = {n: at for n, at in layout.places(self.names).items() if n in wanted}
        return {
            n: describe_parameters(layout.model.effect(n), self.theta[at], self.std[at])
            for n, at in places.items()
        }


def refit(
    passes: MapReduce, layout: Layout, found: FittedHypothesis, extent: Extent, cut: WindowCut, floor: Array
) -> Refit:
    """Fit an explanation to all windows by Gauss and Newton, each step a pass over the parts.

    Args:
        passes: over the parts, whose initial states a look has settled.
        layout: stated values.
        found: the explanation, as fitted to a sample: where to begin, its priors, and its weights.
        extent: how far the log reaches.
        cut: how windows are cut.
        floor: (18,) no channel is trusted beyond.
    """
    names, priors = found.names, found.fitted.priors
    model = layout.model.rebuilt(layout.model.copied_effects())
    theta = found.fitted.theta.copy()
    low, high = limits(model, names, priors)
    point = LinearisationPoint(replace(layout, model=model), (), extent, names, found.fitted.sigma, cut, 1)
    done, steps = False, 0
    while True:
        set_parameters(model, names, theta)
        sums = passes.sums(
            point, f"fitting {', '.join(found.effects) or 'the coefficients'}, step {steps}", moved=True
        )
        if done or steps == STEPS or not len(theta):
            break
        known = NormalEquations.with_priors(sums.hessian, sums.slope, priors.square, theta - priors.mean)
        step = known.bounded(low - theta, high - theta)
        done = float(step @ known.square @ step) < ENOUGH
        theta, steps = theta + step, steps + 1
    std = _errors(passes, point, sums, priors, theta, list(layout.places(names).values()))
    std = std if found.systematic is None else np.hypot(std, found.systematic)
    slow = slower_than_white(sums.channel, sums.count, sums.rough, sums.pairs, sums.windows, floor)
    return Refit(names, parameters_of(model, names), std, sums, steps, done or not len(theta), slow)


def _errors(
    passes: MapReduce,
    point: LinearisationPoint,
    sums: WindowSums,
    priors: Priors,
    theta: Array,
    blocks: Sequence[NDArray[np.int64]],
) -> Array:
    """Return standard errors as `standard_errors` does, for each effect's columns at a time."""
    size = len(sums.slope)
    whole = NormalEquations(sums.hessian + priors.square, sums.slope)
    covariance = whole.covariance()
    combinations, informations = [], []
    for own in blocks:
        others = np.setdiff1d(np.arange(size), own)
        left = whole.eliminate(own, others, rcond=1e-12)
        scores = np.zeros((len(own), size))
        scores[:, own], scores[:, others] = np.eye(len(own)), -left.carry
        combinations.append(Combination(scores, scores, np.zeros(size)))
        informations.append(left.equations.square)
    std = np.full(size, np.nan)
    spreads = [m.spread() for m in passes.moments(point, combinations, "standard errors")]
    for own, spread, information in zip(blocks, spreads, informations, strict=True):
        variance = np.maximum(np.diag(covariance)[own], 0.0)
        known = variance * priors.precision[own] < DETERMINED**2
        known &= is_possible(variance, np.diag(whole.square)[own], theta[own])
        std[own] = np.where(known, np.sqrt(variance * ratio(spread, information, sums.windows)), np.nan)
    return std
