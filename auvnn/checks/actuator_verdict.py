"""What a regression on the actuators gives: the likeliest assignment, which of it is known, and what to do about it.

Thrusters that an allocation drives (eight by six commands) never move alone. Their columns are not estimable one by
one, but the gain of each is wherever eight unknowns meet 36 measured numbers: what a reversed thruster i does to
commanded forces, B (I - 2 e_i e_i') B^+ = I - 2 b_i (e_i' B^+), has a separate direction. So nothing is asked about
which columns are independent; each gain's posterior standard deviation says whether the log determines it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.checks import regression
from auvnn.checks.actuator_regression import (
    DEAD,
    EXCITED,
    SOUND,
    SURE,
    TIE,
    Assignment,
    _ActuatorRegression,
    _alone,
)

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
# Standard deviation of a gain from which on the log says nothing of that actuator; before the log it is 0.5.
TOLD = 0.2
# A dead actuator gives less than this with a probability of 99.5 %: a worn or fouled one gives more.
WEAK, QUANTILE = 0.5, 2.58


@dataclass(frozen=True)
class Judged:
    """The likeliest assignment of the actuators that were looked at.

    Attributes:
        best: the assignment.
        cost: its chi-square.
        confidence: its share of the odds among all that say something else.
        gains: (n,) under it.
        told: (n,) of which the log speaks.
        dead: (n,) which give next to nothing.
        ties: pairs whose exchange changes nothing.
    """

    best: Assignment
    cost: float
    confidence: float
    gains: Array
    told: NDArray[np.bool_]
    dead: NDArray[np.bool_]
    ties: list[tuple[int, int]]


def independent(columns: Array) -> int:
    """Return in how many independent directions columns move, by their singular values."""
    values = np.linalg.svd(columns, compute_uv=False) / np.sqrt(len(columns))
    return int((values > EXCITED * values.max(initial=0.0)).sum()) if values.max(initial=0.0) > 0 else 0


def judged(problem: _ActuatorRegression) -> Judged:
    """Search the assignments, and say what is known of the likeliest one."""
    best, costs = problem.search()
    gains, spread = problem.gains(best), problem.spread(best)
    told = spread < TOLD
    dead = told & (gains < DEAD) & (gains + QUANTILE * spread < WEAK)
    # The sign of what is dead is no difference, and neither is anything that the log does not determine.
    known = np.flatnonzero(told & ~dead)
    cost = np.array(list(costs.values()))
    odds = np.exp(-0.5 * (cost - cost.min()))
    rivals = sum(
        float(o) for a, o in zip(costs, odds, strict=True) if not problem.same(a, best, known.tolist())
    )
    own = float(np.exp(-0.5 * (costs[best] - cost.min())))
    ties = [(i, j) for i, j in problem.ties(best, costs) if told[i] and told[j]]
    return Judged(best, problem.cost(best), own / (own + rivals), gains, told, dead, ties)


@dataclass(frozen=True)
class ByAxis:
    """Forces and moments of all actuators together.

    Attributes:
        gains: over what is stated, signed, by axis.
        findings: which are turned round, in words.
        turned: the same, 0 to 5.
        confidence: of the findings.
        cost: chi-square.
        misfit: root mean square distance, in standard errors.
    """

    gains: dict[str, float]
    findings: list[str]
    turned: list[int]
    confidence: float
    cost: float
    misfit: float

    def to_dict(self) -> dict[str, float]:
        """Return the gains."""
        return self.gains

    def explains_more(self, by_actuator: Judged) -> bool:
        """Say whether axes that are turned round explain the log well, and better than changes of single actuators.

        Each change counts against an explanation: two pairs of thrusters exchanged and reversed are an axis turned
        round. A whole axis has more ways of being mimicked by what a model lacks (a payload's moment) than one
        thruster has, and so has to fit better.
        """
        sure = bool(self.findings) and self.confidence >= SURE and self.misfit < SOUND / 2
        changes = len(self.findings) - by_actuator.best.changes
        return sure and self.cost + 2 * TIE * changes < by_actuator.cost


def by_axis(
    data: regression.RegressionRows,
    thrust: Array,
    wanted: Array,
    allocation: Array,
    inverse: NDArray[np.floating],
) -> ByAxis | None:
    """Return what forces and moments commands cause along each axis, over what is stated; None where none moves.

    Args:
        data: of the log.
        thrust: (N, n), nuisance taken out.
        wanted: (N, 6) acceleration that commands cause, nuisance taken out.
        allocation: (6, n).
        inverse: (6, 6) of the inertia matrix.
    """
    force = thrust @ allocation.T
    most = np.abs(data.thrust @ allocation.T).max(0)
    alone = _alone(force[:, most > 1e-9]) > EXCITED * most[most > 1e-9]
    axes = np.flatnonzero(most > 1e-9)[alone]
    if not len(axes):
        return None
    problem = _ActuatorRegression.of(
        data, force[:, axes], wanted, np.asarray(inverse[:, axes], dtype=np.float64)
    )
    found = judged(problem)
    gains = {AXES[k]: float(found.gains[j] * found.best.sign[j]) for j, k in enumerate(axes) if found.told[j]}
    turned = [
        int(k) for j, k in enumerate(axes) if found.told[j] and found.best.sign[j] < 0 and not found.dead[j]
    ]
    findings = [f"all that drives {AXES[k]} is turned round" for k in turned]
    misfit = float(np.sqrt(problem.distance(found.best)))
    return ByAxis(gains, findings, turned, found.confidence, found.cost, misfit)


def cures(findings: Sequence[str]) -> list[str]:
    """Return what to do about findings, each said once."""
    out = []
    if any("reversed" in f for f in findings):
        out.append(
            "a reversed thruster: turn its `direction` in the model file, or give its command column `scale: -1` in the "
            "mapping"
        )
    if any("exchanged" in f for f in findings):
        out.append(
            "exchanged thrusters: name the command columns in the order of the model file in the mapping"
        )
    if any("of the stated thrust" in f for f in findings):
        out.append(
            "a dead or stuck thruster: look at its cable, driver and propeller, and for this log give its command column "
            "`value: 0` in the mapping"
        )
    if any("turned round" in f for f in findings):
        out.append(
            "an axis turned round: correct the directions of the thrusters in the model file (forward, starboard, "
            "down), or give the velocity of that axis `scale: -1` in the mapping"
        )
    return out
