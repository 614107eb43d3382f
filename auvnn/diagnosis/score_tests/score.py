"""Is an effect missing? One test at the null for every effect, with what else is uncertain taken out.

At the fitted null the residual's slope towards an effect's parameters (the score) is compared with what chance
allows. Coefficients that are merely uncertain take their share first, weighted by their stated amounts. The
variance holds for residuals that are correlated in time: it is the larger of the white-noise one and the
one that the windows' own scores show, neighbours included (Newey and West, 1987).

Reference: Rao (1948) for the score test; Newey and West (1987), Econometrica 55(3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from auvnn.diagnosis.hypotheses.plausible_sizes import heavy
from auvnn.diagnosis.hypotheses.stated_priors import DETERMINED, FREE, Layout, priors, scales
from auvnn.diagnosis.score_tests.few_windows import are_few, freedom
from auvnn.diagnosis.score_tests.variance_inflation import TINY, inverse_root, share_left, variance_inflation
from auvnn.estimation.nuisance_elimination import NormalEquations, carry_of
from auvnn.estimation.priors import parameters_of
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.estimation.window_sums.sufficient_statistics import InformationShares, ScoreMoments

Array = NDArray[np.float64]
# Information on a parameter in units of its plausible scale that leaves it no better known than its prior does.
BLIND = (DETERMINED**-2 - 1.0) / FREE**2


@dataclass(frozen=True)
class Score:
    """The test of one effect.

    Attributes:
        effect: name.
        p_value: of the hypothesis that nothing but the stated uncertainty is at work.
        statistic: quadratic form of the score, inflation divided out.
        degrees: parameters that the log says anything about.
        inflation: variance of the score over that of white noise, at least one.
        estimate: (p,) one-step estimate of the parameters.
        std: (p,) its standard errors, inflated; NaN where the log says no more than the prior.
        evidence: natural logarithm of the Bayes factor for the effect, with parameters of plausible size.
        gain: fall of the weighted squared error that the estimate promises.
    """

    effect: str
    p_value: float
    statistic: float
    degrees: int
    inflation: float
    estimate: Array
    std: Array
    evidence: float
    gain: float


def project(
    statistics: Statistics, layout: Layout, base: Sequence[str], effect: str, free: Sequence[str] = ()
) -> tuple[Array, Array, Array]:
    """Return score (B, p) by window, its gradient at the null (p,) and information (p, p), the base taken out.

    The effect itself is left out of the base where it stands for a stated uncertainty.

    Args:
        statistics: sums of the windows at the null.
        layout: which columns belong to which effect.
        base: nuisance parameters, by effect.
        effect: that is tested.
        free: effects of the base whose priors are wide.
    """
    found = projection(statistics.total, statistics.slope.sum(0), layout, base, effect, free)
    by_window = statistics.slope[:, found.own] - statistics.slope[:, found.others] @ found.carry.T
    return by_window, found.gradient, found.information


@dataclass(frozen=True)
class Projection:
    """What is left of an effect's columns once the base has taken its share.

    Attributes:
        own: the effect's columns, (p,).
        others: the base's columns that can move, (f,).
        carry: (p, f), how the scores of the base go into those of the effect.
        gradient: at the null, (p,).
        information: (p, p).
    """

    own: NDArray[np.int64]
    others: NDArray[np.int64]
    carry: Array
    gradient: Array
    information: Array


def projection(
    total: Array, slope: Array, layout: Layout, base: Sequence[str], effect: str, free: Sequence[str] = ()
) -> Projection:
    """Return an effect's gradient and information by the sums over all windows, the base taken out.

    Args:
        total: J^T J, (P, P).
        slope: J^T e, (P,).
        layout: stated values.
        base: effects that are free anyway.
        effect: the one that is asked for.
        free: those of the base whose stated uncertainty is left out.
    """
    others = [n for n in base if n != effect]
    f, c = layout.of(others), layout.columns[effect]
    held = priors(layout, others, free)
    theta = _values(layout, others)
    # What is at the end of its reach cannot move further to take the candidate's share.
    movable = held.inside(theta)
    f, pull = f[movable], held.pull(theta)[movable]
    square, right = total.copy(), slope.copy()
    square[np.ix_(f, f)] += held.square[np.ix_(movable, movable)]
    right[f] -= pull
    left = NormalEquations(square, right).eliminate(c, f)
    return Projection(c, f, left.carry, left.equations.right, left.information)


def _values(layout: Layout, names: Sequence[str]) -> Array:
    """Return the values of effects and of stand-ins, which are at their nulls, joined, (P,)."""
    each = [layout.means[n] if "@" in n else parameters_of(layout.model, [n]) for n in names]
    return np.concatenate(each) if each else np.zeros(0)


def _information_by_window(
    statistics: Statistics, layout: Layout, base: Sequence[str], effect: str, free: Sequence[str]
) -> Array:
    """Return what each window says of an effect's parameters, (B, p, p), the base following."""
    c, f, carry = following(statistics.total, layout, base, effect, free)
    both, turn = np.concatenate([c, f]), np.hstack([np.eye(len(c)), -carry])
    return turn @ statistics.block(both) @ turn.T


def following(
    total: Array, layout: Layout, base: Sequence[str], effect: str, free: Sequence[str] = ()
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return an effect's columns, those of the base, and how these follow a step of the effect's, (p, f).

    Args:
        total: normal matrix of all columns, (P, P).
        layout: which columns belong to which effect.
        base: nuisance parameters, by effect.
        effect: that is tested.
        free: effects of the base whose priors are wide.
    """
    others = [n for n in base if n != effect]
    f, c = layout.of(others), layout.columns[effect]
    inner = total[np.ix_(f, f)] + priors(layout, others, free).square
    return c, f, carry_of(inner, total[np.ix_(f, c)])


def score(
    statistics: Statistics, layout: Layout, base: Sequence[str], effect: str, free: Sequence[str] = ()
) -> Score:
    """Test one effect at the fitted null; see the module's text.

    Args:
        statistics: sums of the windows at the null.
        layout: which columns belong to which effect.
        base: nuisance parameters, by effect.
        effect: that is tested.
        free: effects of the base whose priors are wide.
    """
    by_window, gradient, information = project(statistics, layout, base, effect, free)
    windows = len(by_window)

    def factor(step: Array, spent: int) -> float:
        # An effect that shows in few windows makes their scores differ; that is no noise, and is taken out first.
        by_itself = _information_by_window(statistics, layout, base, effect, free)
        left = by_window - by_itself @ step
        if not are_few(windows, spent):
            return variance_inflation(left, information, statistics.run, spent)
        root = inverse_root(information)
        shares = ScoreMoments.of(InformationShares.rows(by_itself, root), statistics.run)
        noise = share_left(shares, root.shape[1])
        return variance_inflation(left, information, statistics.run, left=noise)

    return score_from_sums(layout, effect, gradient, information, factor, len(by_window))


def score_from_sums(
    layout: Layout,
    effect: str,
    gradient: Array,
    information: Array,
    factor_of: Callable[[Array, int], float],
    windows: int,
) -> Score:
    """Test one effect by its gradient and information at the null.

    Args:
        layout: stated values.
        effect: its name.
        gradient: (p,), the base taken out.
        information: (p, p), the base taken out.
        factor_of: the scores' inflation, given the step (p,) that the test estimates and the degrees of freedom spent.
        windows: how many there are.
    """
    scale = scales(layout, effect)
    now = _values(layout, [effect])
    # Work in units of the plausible scale, so that one threshold tells what the log says nothing about.
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    seen = values > max(TINY * values.max(initial=0.0), BLIND)
    if not seen.any():
        size = len(scale)
        return Score(effect, 1.0, 0.0, 0, 1.0, now, np.full(size, np.nan), -0.0, 0.0)
    posterior = vectors**2 @ (1.0 / (np.maximum(values, 0.0) + FREE**-2))
    unseen = FREE**2 * (vectors[:, ~seen] ** 2).sum(1)
    values, vectors = values[seen], vectors[:, seen]
    along = vectors.T @ (gradient * scale) / values  # one-step estimate, in scales
    factor = factor_of(scale * (vectors @ along), 1 + len(values))
    spread = factor / values
    prior = _prior_variance(layout, effect, vectors)
    if prior is None:
        centre = np.zeros(len(values))
        statistic = float(np.sum(along**2 / spread))
        # What the data know to 1 / spread is likely to be by 1 + spread, with the tail of what is a guess.
        likely = heavy(along / np.sqrt(spread + 1.0))
        evidence = 0.5 * float(np.sum(along**2 / spread - likely - np.log1p(1.0 / spread)))
    else:
        # The coefficient counts as missing only beyond what was stated of it.
        mean = layout.means[effect]
        centre = vectors.T @ ((mean - now) / scale)
        off = along - centre
        within, beyond = np.diag(spread) + prior, np.diag(spread + 1.0)
        statistic = float(off @ np.linalg.solve(within, off))
        evidence = 0.5 * float(
            statistic
            - off @ np.linalg.solve(beyond, off)
            + np.linalg.slogdet(within)[1]
            - np.linalg.slogdet(beyond)[1]
        )
    degrees = len(values)
    p_value = float(stats.f.sf(statistic / degrees, degrees, freedom(windows, degrees)))
    estimate = now + scale * (vectors @ along)
    std = scale * np.sqrt(vectors**2 @ spread + unseen)
    std = np.where(posterior < (DETERMINED * FREE) ** 2, std, np.nan)
    gain = float(np.sum((along - centre) ** 2 * values))
    return Score(effect, p_value, statistic, degrees, factor, estimate, std, evidence, gain)


def _prior_variance(layout: Layout, effect: str, vectors: Array) -> Array | None:
    if effect not in layout.nuisance:
        return None
    variance = (layout.spreads[effect] / scales(layout, effect)) ** 2
    return vectors.T @ (variance[:, None] * vectors)


def similarity(statistics: Statistics, layout: Layout, base: Sequence[str], names: Sequence[str]) -> Array:
    """Return how much of each effect's trace in the log another one can imitate, (n, n), row by column.

    Entry (a, b) is the share of the squared sensitivity to a's parameters, each at its plausible scale, that
    lies in the span of b's, after what else is uncertain has been taken out of both.

    Args:
        statistics: sums of the windows.
        layout: which columns belong to which effect.
        base: nuisance parameters, by effect.
        names: effects that are held against one another, n of them.
    """
    out = np.eye(len(names))
    total = statistics.total
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            if i == j:
                continue
            others = [n for n in base if n not in (a, b)]
            f = layout.of(others)
            ca, cb = layout.columns[a], layout.columns[b]
            both = np.concatenate([ca, cb])
            inner = total[np.ix_(f, f)] + priors(layout, others).square
            across = total[np.ix_(f, both)]
            left = total[np.ix_(both, both)] - carry_of(inner, across) @ across
            sa, sb = scales(layout, a), scales(layout, b)
            unit = np.concatenate([sa, sb])
            left = left * unit[:, None] * unit
            k = len(ca)
            # One standard error of b's own noise keeps directions that the log cannot see from imitating anything.
            inside = left[:k, k:] @ np.linalg.solve(left[k:, k:] + np.eye(len(cb)), left[k:, :k])
            whole = np.trace(left[:k, :k])
            out[i, j] = float(np.clip(np.trace(inside) / whole, 0.0, 1.0)) if whole > 1e-12 else 0.0
    return out
