"""Accelerations regressed on each thruster's pattern: gains, exchanged and reversed thrusters."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from auvnn.checks import regression
from auvnn.models import GreyBox

Array = NDArray[np.float64]


GAIN, SPREAD = 1.0, 0.5  # of the static thrust, and how far from it a thruster may be


SMALLEST_GAIN = 0.05


DEAD = 0.15  # of the stated thrust: less is as good as nothing


EXCITED = 0.03  # of full thrust, beyond what the others explain


SURE = 0.95


# Root mean square misfit, in standard errors, from which on an assignment explains the log no better than chance: what
# the model lacks is then read as one actuator doing another's work.
SOUND = 2.0


# Relative misfit that no chi-square counts against an assignment: geometry and inertia are not exact either.
MODEL_ERROR = 0.15


TIE = 2.0  # difference of the misfit below which two assignments are one


# Before the log is looked at: the probability that one actuator is elsewhere or reversed. Hundreds of assignments are
# tried, and without it the likeliest of these by chance would be called sure.
CHANGED = 0.01


ROUNDS = 24


@dataclass(frozen=True)
class Assignment:
    """Which stated actuator answers each command.

    Args:
        place: of each command, which stated actuator, (n,).
        sign: of each command, +1 or -1, (n,).
    """

    place: tuple[int, ...]
    sign: tuple[int, ...]

    @property
    def plain(self) -> bool:
        """Whether nothing is exchanged or reversed."""
        return self.changes == 0

    @property
    def changes(self) -> int:
        """How many actuators are elsewhere or reversed."""
        return sum(k != i or s < 0 for i, (k, s) in enumerate(zip(self.place, self.sign, strict=True)))

    def words(self, names: list[str], silent: Collection[int] = ()) -> list[str]:
        """Say what differs from the model file, but nothing of those actuators that nothing is known of."""
        out = []
        seen: set[int] = set()
        for i, (k, s) in enumerate(zip(self.place, self.sign, strict=True)):
            if i in silent:
                continue
            if k == i and s < 0:
                out.append(f"{names[i]} is reversed")
            if k != i and i not in seen:
                cycle, at = [i], k
                while at != i and at not in cycle:
                    cycle.append(at)
                    at = self.place[at]
                seen |= set(cycle)
                turned = [names[c] for c in cycle if self.sign[c] < 0]
                what = (
                    " and ".join(names[c] for c in cycle)
                    if len(cycle) == 2
                    else " -> ".join(names[c] for c in [*cycle, cycle[0]])
                )
                out.append(f"{what} are exchanged" + (f" ({', '.join(turned)} reversed)" if turned else ""))
        return out


def _names(model: GreyBox) -> list[str]:
    if model.actuation == "wrench":
        return [f"tau_{a}" for a in "XYZKMN"]
    return [f"thruster_{i + 1}" for i in range(model.actuators.size)]


def _alone(thrust: Array) -> Array:
    """Return the root mean square of each column that the others do not explain, (n,)."""
    gram = thrust.T @ thrust / len(thrust)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    correlation = gram / np.outer(scale, scale) + 1e-9 * np.eye(len(gram))
    return scale / np.sqrt(np.maximum(np.diag(np.linalg.inv(correlation)), 1.0))


@dataclass
class _ActuatorRegression:
    """Estimated columns and what an assignment would have them be.

    Args:
        estimate: (6, n) acceleration per newton of each command.
        stated: (6, n) of the model file.
        gram: (n, n), newtons squared, summed over the samples and divided by the inflation.
        weight: (6,) one over the variance of the residual.
    """

    estimate: Array
    stated: Array
    gram: Array
    weight: Array

    @classmethod
    def of(
        cls, data: regression.RegressionRows, thrust: Array, wanted: Array, stated: Array
    ) -> _ActuatorRegression:
        """Regress, once more with outliers left out, and work out what the estimates are worth."""
        keep = np.ones(len(wanted), dtype=bool)
        solution = np.zeros((thrust.shape[1], 6))
        for _ in range(2):
            solution = np.linalg.lstsq(thrust[keep], wanted[keep], rcond=1e-10)[0]
            left = wanted - thrust @ solution
            spread = 1.4826 * np.median(np.abs(left), axis=0) + 1e-12
            keep = (np.abs(left) < 6.0 * spread).all(1)
        left = (wanted - thrust @ solution)[keep]
        factor = regression.variance_inflation(data, left, thrust[keep])
        gram = thrust[keep].T @ thrust[keep] / factor
        estimate = np.asarray(solution.T, dtype=np.float64)
        # A share of the stated columns' own effect counts as error: nothing about a model is exact.
        effect = np.einsum("di,ij,dj->d", stated, gram, stated) / max(len(gram), 1)
        variance = (left**2).mean(0) + MODEL_ERROR**2 * effect
        return cls(estimate, stated, gram, 1.0 / np.maximum(variance, 1e-300))

    def columns(self, a: Assignment) -> Array:
        """Return what the stated columns are under an assignment, (6, n)."""
        return self.stated[:, list(a.place)] * np.array(a.sign, dtype=float)

    def gains(self, a: Assignment) -> Array:
        """Return the gains (n,) that fit best, positive, each within reason of one."""
        c = self.columns(a)
        square = np.einsum("di,d,dj->ij", c, self.weight, c) * self.gram + np.eye(c.shape[1]) / SPREAD**2
        right = np.einsum("di,d,dj,ij->i", c, self.weight, self.estimate, self.gram) + GAIN / SPREAD**2
        gains = np.linalg.solve(square, right)
        for _ in range(len(gains)):
            low = gains < SMALLEST_GAIN
            if not low.any():
                break
            free = ~low
            gains = np.where(low, SMALLEST_GAIN, gains)
            if free.any():
                rest = right[free] - square[np.ix_(free, low)] @ gains[low]
                gains[free] = np.linalg.solve(square[np.ix_(free, free)], rest)
                if (gains[free] >= SMALLEST_GAIN).all():
                    break
        return np.maximum(gains, SMALLEST_GAIN)

    def spread(self, a: Assignment) -> Array:
        """Return the standard deviations of the gains under an assignment, (n,), at most that assumed before."""
        c = self.columns(a)
        square = np.einsum("di,d,dj->ij", c, self.weight, c) * self.gram + np.eye(c.shape[1]) / SPREAD**2
        return np.sqrt(np.diag(np.linalg.inv(square)))

    def distance(self, a: Assignment) -> float:
        """Return the mean squared distance of the estimates from an assignment, in variances."""
        return self.cost(a) / self.estimate.size

    def cost(self, a: Assignment) -> float:
        """Return chi-square of an assignment with its best gains."""
        gains = self.gains(a)
        gap = self.estimate - self.columns(a) * gains
        return float(
            np.einsum("di,d,dj,ij->", gap, self.weight, gap, self.gram)
            + (((gains - GAIN) / SPREAD) ** 2).sum()
        )

    def weighed(self, a: Assignment) -> float:
        """Return minus twice the log posterior of an assignment: chi-square, and the price of each change."""
        return self.cost(a) - 2.0 * np.log(CHANGED) * a.changes

    def search(self) -> tuple[Assignment, dict[Assignment, float]]:
        """Return the likeliest assignment, and `weighed` of all that were looked at: from the stated one downhill."""
        n = self.stated.shape[1]
        current = Assignment(tuple(range(n)), (1,) * n)
        costs = {current: self.weighed(current)}
        for _ in range(ROUNDS):
            around = _neighbours(current)
            for a in around:
                if a not in costs:
                    costs[a] = self.weighed(a)
            best = min(around, key=lambda a: costs[a])
            # The model file is believed unless something else is better beyond doubt.
            if costs[best] > costs[current] - TIE:
                break
            current = best
        return current, costs

    def same(self, a: Assignment, b: Assignment, which: Sequence[int] | slice = slice(None)) -> bool:
        """Say whether two assignments put like columns into the same places, or into some of them."""
        mine, theirs = self.columns(a)[:, which], self.columns(b)[:, which]
        return bool(np.allclose(mine, theirs, rtol=1e-6, atol=1e-12))

    def ties(self, best: Assignment, costs: dict[Assignment, float]) -> list[tuple[int, int]]:
        """Return the pairs of commands whose exchange changes the misfit by next to nothing."""
        out = []
        for i, j in combinations(range(len(best.place)), 2):
            other = _exchanged(best, i, j)
            if other in costs and abs(costs[other] - costs[best]) < TIE:
                out.append((i, j))
        return out


def _exchanged(a: Assignment, i: int, j: int) -> Assignment:
    place, sign = list(a.place), list(a.sign)
    place[i], place[j], sign[i], sign[j] = place[j], place[i], sign[j], sign[i]
    return Assignment(tuple(place), tuple(sign))


def _turned(a: Assignment, *which: int) -> Assignment:
    return Assignment(a.place, tuple(-s if i in which else s for i, s in enumerate(a.sign)))


def _neighbours(a: Assignment) -> list[Assignment]:
    """Return what one turn, one exchange (with turns), or a turn or reversal of all makes of an assignment."""
    n = len(a.place)
    found = [_turned(a, i) for i in range(n)]
    for i, j in combinations(range(n), 2):
        b = _exchanged(a, i, j)
        found += [b, _turned(b, i), _turned(b, j), _turned(b, i, j)]
    found.append(_turned(a, *range(n)))
    found.append(Assignment(a.place[::-1], a.sign[::-1]))
    return list(dict.fromkeys(found))
