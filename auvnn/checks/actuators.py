"""Are the thrusters where the model file puts them? Reversed, exchanged or dead ones, by the pattern they leave.

What acceleration follows each command is estimated from the log by regression, drag, products of velocities, gravity
and constants fitted beside, and held against the columns of M^-1 B of the model: a reversed thruster has its column
turned round, two exchanged ones each other's. Assignments are searched by turning and exchanging, each weighed by
chi-square with a free positive gain per actuator (thrust curves are never exact), and given with the odds against
every other assignment that was looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import plain
from auvnn.checks import regression
from auvnn.checks.actuator_regression import (
    DEAD,
    EXCITED,
    SURE,
    TIE,
    Assignment,
    _ActuatorRegression,
    _alone,
    _names,
)
from auvnn.errors import AuvnnError
from auvnn.logs import Log
from auvnn.metrics.one_step import inertia_of
from auvnn.models import GreyBox

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ActuatorCheck:
    """What a log says of a model's actuators.

    Args:
        names: of the actuators.
        as_stated: whether the model file's order and signs hold.
        findings: in words, what is exchanged, reversed or dead.
        confidence: share of the odds, among all assignments tried, of the one found.
        assignment: the one found.
        gains: thrust of each over what the model file states, under it; NaN where the log says nothing.
        untold: actuators that the log does not move enough by themselves.
        alike: groups of actuators whose exchange would make no difference that this log could show.
        misfit: root mean square distance of the estimated columns from the stated ones, in standard errors.
    """

    names: list[str]
    as_stated: bool
    findings: list[str]
    confidence: float
    assignment: Assignment
    gains: Array
    untold: list[str]
    alike: list[list[str]] = field(default_factory=list)
    misfit: float = 0.0

    @property
    def sure(self) -> bool:
        """Whether something is wrong, and known with a confidence of 95 %."""
        return bool(self.findings) and self.confidence >= SURE

    @property
    def words(self) -> list[str]:
        """The answer as warnings; empty where nothing is wrong or nothing can be said with confidence."""
        if not self.sure:
            return []
        what = "; ".join(self.findings)
        return [
            f"actuators: {what} (confidence {100 * min(self.confidence, 0.999):.3g} %): check order and signs of the "
            "command columns against the model file"
        ]

    @property
    def story(self) -> list[str]:
        """The answer in sentences, whatever it is."""
        if len(self.untold) == len(self.names):
            return [
                "the log does not move the actuators independently of one another: nothing can be said of them"
            ]
        odds = f"confidence {100 * min(self.confidence, 0.999):.3g} %"
        out = [
            f"{'; '.join(self.findings)} ({odds})"
            if self.findings
            else f"as the model file states them ({odds})"
        ]
        if self.untold:
            out.append(
                f"nothing can be said of {', '.join(self.untold)}: not moved independently of the others"
            )
        out += [f"{' and '.join(pair)} cannot be told from each other" for pair in self.alike]
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return plain(
            {
                "as_stated": self.as_stated,
                "findings": self.findings,
                "confidence": self.confidence,
                "gains": dict(zip(self.names, self.gains, strict=True)),
                "place": dict(zip(self.names, [self.names[k] for k in self.assignment.place], strict=True)),
                "sign": dict(zip(self.names, self.assignment.sign, strict=True)),
                "cannot_tell": self.untold,
                "alike": self.alike,
                "story": self.story,
            }
        )


def check_actuators(model: GreyBox, log: Log) -> ActuatorCheck:
    """Say which actuators of a model are exchanged, reversed or dead, by a log.

    Args:
        model: the model, driven by what the log has.
        log: measurements in which the actuators move independently of one another.

    Raises:
        InputError: the log lacks the commands that drive the model.
    """
    data = regression.regression_rows(model, log)
    names = _names(model)
    inverse = np.linalg.inv(inertia_of(model, log.runs[0]))
    stated = inverse @ model.actuators.allocation.numpy()
    # The model's own thrust is put back: what is regressed is all of the acceleration that commands cause.
    wanted = regression.without(data.nuisance, data.gap + data.thrust @ stated.T)
    thrust = regression.without(data.nuisance, data.thrust)
    full = np.maximum(np.abs(data.thrust).max(0), 1e-9)
    moved = _alone(thrust) > EXCITED * full
    told = np.flatnonzero(moved)
    untold = [names[i] for i in np.flatnonzero(~moved)]
    same = Assignment(tuple(range(len(names))), (1,) * len(names))
    gains = np.full(len(names), np.nan)
    if len(told) == 0 or len(wanted) < 20 * len(names):
        return ActuatorCheck(names, True, [], 0.0, same, gains, untold or names)
    # What the log does not move independently stays as stated.
    wanted = np.asarray(wanted - thrust[:, ~moved] @ stated[:, ~moved].T, dtype=np.float64)
    problem = _ActuatorRegression.of(
        data, thrust[:, told], wanted, np.asarray(stated[:, told], dtype=np.float64)
    )
    place = {int(i): k for k, i in enumerate(told)}
    best, costs = problem.search()
    found = Assignment(
        tuple(int(told[best.place[place[i]]]) if i in place else i for i in range(len(names))),
        tuple(best.sign[place[i]] if i in place else 1 for i in range(len(names))),
    )
    cost = np.array(list(costs.values()))
    least = float(cost.min())
    rivals = np.exp(-0.5 * (cost - least))
    alike = [[names[told[i]], names[told[j]]] for i, j in problem.ties(best, costs)]
    confidence = float(
        np.exp(-0.5 * (costs[best] - least))
        / (
            rivals.sum()
            - sum(
                rivals[k]
                for k, a in enumerate(costs)
                if a != best and costs[a] - least < TIE and problem.same(a, best)
            )
        )
    )
    gains[told] = problem.gains(best)
    words = found.words(names)
    dead = [i for i in told if gains[i] < DEAD]
    words += [f"{names[i]} gives {100 * gains[i]:.0f} % of the stated thrust" for i in dead]
    return ActuatorCheck(
        names,
        not words,
        words,
        confidence,
        found,
        gains,
        untold,
        alike,
        float(np.sqrt(problem.distance(best))),
    )


def doubts(model: GreyBox, log: Log) -> list[str]:
    """Return what to warn of; nothing where the check cannot be made."""
    try:
        return check_actuators(model, log).words
    except (AuvnnError, np.linalg.LinAlgError):
        return []
