"""What names leave, asked of every measured input: a force that goes with one refutes a name that stood in for it.

`variance_component` assumes nothing of a force's course and pays for that with power. A force that is a function of one
measured input needs three or four parameters in a degree of freedom, and shows where a name has explained nine tenths
of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, shapes
from auvnn.diagnosis.residuals.input_forces import AXES, InputForces
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Directions of a force of which the log says less than this, beside the best known one, are not asked for.
SEEN = 1e-6


@dataclass(frozen=True)
class AdditiveForce:
    """The force of one measured input that what is left looks most like.

    Attributes:
        axis: degree of freedom, "X" to "N".
        input: name, as `depends_on` has it.
        p_value: of there being no such force, corrected for all inputs and degrees of freedom; at most one.
        needless: names that explain nothing beyond chance once this force is in the model.
        share: of the error above noise that the force would explain, 0 to 1.
    """

    axis: str
    input: str
    p_value: float
    needless: tuple[str, ...]
    share: float = 0.0


def additive_force_test(
    explanation: FittedHypothesis,
    layout: Layout,
    windows: Windows,
    sigma: Array,
    names: Sequence[str],
    alpha: float,
) -> AdditiveForce:
    """Ask of every measured input and degree of freedom whether a force of it is left, and who is needed beside it.

    A score test for each (Rao, 1948), with all that was fitted as nuisance and the variance that the windows' own scores
    show; then, with the force that is most significant in the model, Wald's test for each name.

    Args:
        explanation: the fit with the names.
        layout: stated values.
        windows: those it was fitted to.
        sigma: (18,) standard deviations of the noise, infinite for channels that do not count; see
            `variance_component.white`.
        names: effects that were given as names.
        alpha: significance that a name must reach to be needed.
    """
    fitted = explanation.fitted
    probe = InputForces(fitted.model, windows)
    known, per_axis = len(fitted.theta), len(probe.parameters_of) // 6
    # A degree of freedom has its columns behind those of what was fitted.
    blocks = {n: known + probe.columns(0, n) for n in probe.inputs}
    by_axis = [_ForceSums(explanation, blocks) for _ in AXES]
    for part in _by_part(explanation, probe, windows, sigma):
        for sums, statistics in zip(by_axis, part, strict=True):
            sums.add(statistics)
    scale = np.array([p.scale for p in probe.parameters_of]).reshape(6, per_axis)
    tested = {
        (i, n): _tested(sums, n, scale[i, own - known])
        for i, sums in enumerate(by_axis)
        for n, own in blocks.items()
    }
    p_values = {key: p_value for key, (p_value, _) in tested.items()}
    i, best = min(p_values, key=lambda key: p_values[key])
    size = scale[i, blocks[best] - known]
    needless = tuple(n for n in names if _need(by_axis[i], layout, blocks[best], size, n) > alpha)
    count, usable = fitted.statistics.count.sum(0), np.isfinite(sigma)
    spent = 12 * len(fitted.statistics.cost) * count / max(count.sum(), 1.0)
    left = (
        (fitted.statistics.channel.sum(0)[usable] / sigma[usable] ** 2 - (count - spent)[usable])
        .clip(0.0)
        .sum()
    )
    share = float(np.clip(tested[i, best][1] / left, 0.0, 1.0)) if left > 0 else 0.0
    return AdditiveForce(AXES[i], best, min(1.0, p_values[i, best] * len(p_values)), needless, share)


def _by_part(
    explanation: FittedHypothesis, probe: InputForces, windows: Windows, sigma: Array
) -> Iterator[list[Statistics]]:
    """Yield for some windows at a time the statistics of each degree of freedom, what was fitted first.

    The products of one degree of freedom's columns with another's are not asked for, and would be most of the work.
    """
    fitted = explanation.fitted
    model, known = fitted.model, len(fitted.theta)
    asked = model.extended_by(probe)
    columns = [np.concatenate([np.arange(known), known + probe.columns(i)]) for i in range(6)]
    begin = 0
    for answer in linearise(asked, windows, fitted.initial, [*explanation.names, str(probe.name)]):
        part = windows.pick(slice(begin, begin + len(answer.error)))
        begin += len(answer.error)
        each = [
            Response(answer.error, answer.state, answer.parameters[..., c], answer.force) for c in columns
        ]
        yield [normal_equations(part, [one], sigma)[0].finite() for one in each]


class _ForceSums:
    """What the tests of one degree of freedom need of all windows' products.

    Args:
        explanation: the fit, K parameters of which can move.
        blocks: columns of each input's force.
    """

    def __init__(self, explanation: FittedHypothesis, blocks: dict[str, NDArray[np.int64]]) -> None:
        """Begin with nothing."""
        self.explanation, self.blocks = explanation, blocks
        fitted = explanation.fitted
        self.inside = np.flatnonzero(fitted.priors.inside(fitted.theta))
        self.precision = fitted.priors.square[np.ix_(self.inside, self.inside)]
        self.pull = fitted.priors.pull(fitted.theta)[self.inside]
        self.total = np.zeros((0, 0))
        self._slopes: list[Array] = []
        self._across: list[Array] = []
        self._own: dict[str, list[Array]] = {key: [] for key in blocks}
        self._runs: list[NDArray[np.int64]] = []

    def add(self, statistics: Statistics) -> None:
        """Take in some windows."""
        self.total = statistics.total + self.total if self.total.size else statistics.total
        self._slopes.append(statistics.slope)
        self._across.append(statistics.hessian[:, self.inside])
        for key, own in self.blocks.items():
            self._own[key].append(statistics.hessian[:, own[:, None], own])
        self._runs.append(statistics.run)

    def held(self, columns: NDArray[np.int64], precision: Array, pull: Array) -> NormalEquations:
        """Return the equations of all windows, some of the columns held by priors.

        Args:
            columns: that are held, K of them.
            precision: of their priors, (K, K).
            pull: the precision times how far they are from the priors' means, (K,).
        """
        square, right = self.total.copy(), self.slope.sum(0)
        square[np.ix_(columns, columns)] += precision
        right[columns] -= pull
        return NormalEquations(square, right)

    @cached_property
    def slope(self) -> Array:
        """J^T e of each window, (W, P)."""
        return np.concatenate(self._slopes)

    @cached_property
    def across(self) -> Array:
        """J^T J of each window between what can move and all, (W, K, P)."""
        return np.concatenate(self._across)

    @cached_property
    def run(self) -> NDArray[np.int64]:
        """Run of each window, (W,)."""
        return np.concatenate(self._runs)

    def own(self, key: str) -> Array:
        """Return J^T J of each window within a force's columns, (W, k, k)."""
        return np.concatenate(self._own[key])


def _tested(sums: _ForceSums, key: str, scale: Array) -> tuple[float, float]:
    """Return the p-value of one force, what was fitted taking its share first, and the fall of the squared error."""
    own, inside = sums.blocks[key], sums.inside
    left = sums.held(inside, sums.precision, sums.pull).eliminate(own, inside, rcond=1e-12)
    carry, gradient = left.carry, left.equations.right * scale
    information = left.information * scale[:, None] * scale
    values, vectors = np.linalg.eigh(information)
    seen = values > SEEN * max(float(values.max()), 1.0)
    if not seen.any():
        return 1.0, 0.0
    along = (vectors.T @ gradient)[seen] / values[seen]
    # A force that shows in few windows makes their scores differ; that is no noise, and is taken out first.
    step = scale * (vectors[:, seen] @ along)
    follow = -carry.T @ step
    across = sums.across
    moved_own = sums.own(key) @ step + np.einsum("wij,i->wj", across[:, :, own], follow)
    moved_inside = across[:, :, own] @ step + across[:, :, inside] @ follow
    by_window = left.scores(sums.slope[:, own] - moved_own, sums.slope[:, inside] - moved_inside)
    degrees = int(seen.sum())
    factor = variance_inflation(by_window * scale, information, sums.run, 1 + degrees)
    fall = float((along**2 * values[seen]).sum())
    return float(chi2.sf(fall / factor, degrees)), fall


def _need(sums: _ForceSums, layout: Layout, own: NDArray[np.int64], scale: Array, name: str) -> float:
    """Return the p-value of a name's parameters being at their null, with a force of some columns in the model."""
    explanation, inside = sums.explanation, sums.inside
    live = np.flatnonzero(~shapes(layout, name))
    wanted, null = layout.places(explanation.names)[name][live], layout.means[name][live]
    kept = np.isin(wanted, inside)
    if not kept.any():
        return 0.0
    wanted, null = wanted[kept], null[kept]
    free = np.concatenate([inside, own])
    # Of the force as little is assumed as keeps what the log does not see at zero.
    precision = np.asarray(block_diag(sums.precision, np.diag(1e-4 * scale**-2.0)))
    pull = np.concatenate([sums.pull, np.zeros(len(own))])
    known = sums.held(free, precision, pull).part(free)
    covariance = known.covariance()
    step = covariance @ known.right
    at = np.searchsorted(inside, wanted)
    moved = explanation.fitted.theta[wanted] + step[at] - null
    spread = covariance[np.ix_(at, at)]
    size = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    inverse = np.linalg.pinv(spread / size[:, None] / size, hermitian=True)
    return float(chi2.sf(float(moved / size @ inverse @ (moved / size)), len(wanted)))
