"""Are the thrusters where the model file puts them? Reversed, exchanged or dead ones, by the pattern they leave.

What acceleration follows each command is estimated from the log by regression, drag, products of velocities, gravity
and constants fitted along, and compared with the columns of M^-1 B of the model: a reversed thruster has its column
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
from auvnn.checks.actuator_prediction import predicts_better
from auvnn.checks.actuator_regression import (
    EXCITED,
    SOUND,
    SURE,
    Assignment,
    _ActuatorRegression,
    _alone,
    _names,
)
from auvnn.checks.actuator_verdict import by_axis, cures, independent, judged
from auvnn.errors import AuvnnError
from auvnn.logs import Log
from auvnn.metrics.one_step import inertia_of
from auvnn.models import GreyBox

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ActuatorCheck:
    """What a log says about a model's actuators.

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
        cures: what to do about the findings.
        axes: force or moment of all actuators together over what is stated, by axis, where they are driven together.
        withdrawn: findings of the regression with which free running predicts the log no better.
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
    cures: list[str] = field(default_factory=list)
    axes: dict[str, float] = field(default_factory=dict)
    withdrawn: list[str] = field(default_factory=list)

    @property
    def sure(self) -> bool:
        """Whether something is wrong, and known with a confidence of 95 %: what is said then also has to fit the log."""
        return bool(self.findings) and self.confidence >= SURE and self.misfit < SOUND

    @property
    def words(self) -> list[str]:
        """The answer as warnings; empty where nothing is wrong or nothing can be said with confidence."""
        if not self.sure:
            return []
        what = "; ".join(self.findings)
        return [
            f"actuators: {what} (confidence {100 * min(self.confidence, 0.999):.3g} %): {'; '.join(self.cures)}"
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
        if self.misfit >= SOUND:
            out[0] = (
                f"{', '.join(n for n in self.names if n not in self.untold)}: the log fits neither the model file nor "
                "reversed, exchanged or dead actuators: something else is missing, nothing is said of them"
            )
        if self.withdrawn:
            out[0] = (
                f"nothing is said of the actuators: the regression finds that {'; '.join(self.withdrawn)}, but with that "
                "free running predicts the log no better; a controller that answers the sensors' noise does this"
            )
        if self.untold:
            out.append(
                f"nothing can be said of {', '.join(self.untold)}: not moved independently of the others"
            )
        out += [f"{' and '.join(pair)} cannot be distinguished" for pair in self.alike]
        if self.axes and (not self.findings or self.assignment.plain):
            shown = ", ".join(f"{a} {100 * g:.0f} %" for a, g in self.axes.items())
            out.append(f"driven together; by axis the log shows of the stated force or moment: {shown}")
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
                "cures": self.cures if self.findings else [],
                **({"axes": self.axes} if self.axes else {}),
                "alike": self.alike,
                **({"withdrawn": self.withdrawn} if self.withdrawn else {}),
                "story": self.story,
            }
        )


def check_actuators(model: GreyBox, log: Log) -> ActuatorCheck:
    """Say which actuators of a model are exchanged, reversed or dead, by a log.

    Args:
        model: the model, driven by what the log has.
        log: measurements in which the actuators move independently of one another, or at least their axes do.

    Raises:
        InputError: the log lacks the commands that drive the model.
    """
    data = regression.regression_rows(model, log)
    names = _names(model)
    inverse = np.linalg.inv(inertia_of(model, log.runs[0]))
    allocation = model.actuators.allocation.numpy()
    stated = inverse @ allocation
    # The model's own thrust is put back: what is regressed is all of the acceleration that commands cause.
    wanted = regression.without(data.nuisance, data.gap + data.thrust @ stated.T)
    thrust = regression.without(data.nuisance, data.thrust)
    full = np.maximum(np.abs(data.thrust).max(0), 1e-9)
    moved = _alone(thrust) > EXCITED * full
    together = not moved.all() and len(wanted) and independent(thrust / full) > 1
    if together:
        # Driven by an allocation: a thruster that never moves alone shows itself by the direction of what it does.
        moved = np.sqrt((thrust**2).mean(0)) > EXCITED * full
    same = Assignment(tuple(range(len(names))), (1,) * len(names))
    gains = np.full(len(names), np.nan)
    if not moved.any() or len(wanted) < 20 * len(names):
        return ActuatorCheck(names, True, [], 0.0, same, gains, names)
    axes = by_axis(data, thrust, wanted, allocation, inverse) if together else None
    # What the log does not move stays as stated.
    wanted = np.asarray(wanted - thrust[:, ~moved] @ stated[:, ~moved].T, dtype=np.float64)
    columns = np.asarray(stated[:, moved], dtype=np.float64)
    problem = _ActuatorRegression.of(data, thrust[:, moved], wanted, columns)
    found = judged(problem)
    told = [int(i) for i in np.flatnonzero(moved)[found.told]]
    if len(told) == 0:
        return ActuatorCheck(names, True, [], 0.0, same, gains, names, axes=axes.to_dict() if axes else {})
    which = np.flatnonzero(moved).tolist()
    place, sign = list(same.place), list(same.sign)
    for k, i in enumerate(which):
        place[i], sign[i] = which[found.best.place[k]], found.best.sign[k]
    gains[told] = found.gains[found.told]
    dead = [i for i, gone in zip(which, found.dead, strict=True) if gone]
    words = Assignment(tuple(place), tuple(sign)).words(
        names, silent=[*dead, *(i for i in which if i not in told)]
    )
    words += [
        f"{names[i]} gives {100 * gains[i]:.0f} % of the stated thrust, whatever its command" for i in dead
    ]
    confidence, misfit = found.confidence, float(np.sqrt(problem.distance(found.best)))
    changed = allocation[:, place] * np.array(sign) * np.where(np.isin(np.arange(len(place)), dead), 0.0, 1.0)
    if axes is not None and axes.explains_more(found):
        words, confidence, misfit = axes.findings, axes.confidence, axes.misfit
        changed = np.where(np.isin(np.arange(6), axes.turned), -1.0, 1.0)[:, None] * allocation
    withdrawn: list[str] = []
    if words and confidence >= SURE and misfit < SOUND and not predicts_better(model, log, changed):
        words, withdrawn, confidence = [], words, 0.0
        place, sign, gains = list(same.place), list(same.sign), np.full(len(names), np.nan)
    return ActuatorCheck(
        names,
        not words,
        words,
        confidence,
        Assignment(tuple(place), tuple(sign)),
        gains,
        [n for i, n in enumerate(names) if i not in told],
        [[names[which[i]] for i in pair] for pair in found.ties],
        misfit,
        cures(words),
        {} if axes is None else axes.to_dict(),
        withdrawn,
    )


def doubts(model: GreyBox, log: Log) -> list[str]:
    """Return what to warn of; nothing where the check cannot be made."""
    try:
        return check_actuators(model, log).words
    except (AuvnnError, np.linalg.LinAlgError):
        return []
