"""Does it matter? What each name, and what is left, costs in free running, and how large the forces are.

The cost of a name is (E without - E with) / E with, E the free-running error over 5 s on runs left out, with everything
else refitted both times. So that a diagnosis stays quick, the fits without each fold are one Newton step from the fit to
all runs: exact where the errors are linear in the parameters over a fold's share of the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import EffectCost, Worst
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.cross_validation.errors import Gain, LeftOut, gain
from auvnn.diagnosis.cross_validation.left_out import left_out_found
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.residuals.forces import AXES, actuators_of, forces_of, share_of
from auvnn.diagnosis.residuals.variance_component_test import Unnamed
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.errors import InputError
from auvnn.metrics.noise_floor import noise_floor
from auvnn.metrics.rollouts import roll, scale_of

Array = NDArray[np.float64]
# Standard errors of a one-sided limit that holds in 19 of 20 logs.
ONE_SIDED = 1.645


@dataclass(frozen=True)
class Cost:
    """What one name costs.

    Attributes:
        gain: fall of the error on what is left out that it brings in addition to the others; None where there is none.
        force: (6,) root mean square, N and N m.
        share: (6,) of the actuators'.
        matters: whether that is beyond the tolerance.
    """

    gain: Gain | None
    force: Array
    share: Array
    matters: bool

    def to_dict(self) -> EffectCost:
        """Return what the answer holds."""
        return {
            "cost": None if self.gain is None else self.gain.cost,
            "worst": worst(self.gain),
            "force": dict(zip(AXES, self.force.tolist(), strict=True)),
            "share": largest(self.share),
            "gain": None if self.gain is None else {"value": self.gain.value, "std": self.gain.std},
            "matters": self.matters,
        }


@dataclass(frozen=True)
class Worth:
    """What the names and the remainder of an answer are worth.

    Attributes:
        names: name to its cost.
        without: name to the fit without it, everything else refitted.
        left: degree of freedom to the force without a name, and its cost; as the answer has it.
        words: how that was worked out.
    """

    names: Mapping[str, Cost] = field(default_factory=dict)
    without: Mapping[str, FittedHypothesis] = field(default_factory=dict)
    left: Mapping[str, Any] = field(default_factory=dict)
    words: str = ""


def worth(asked: Setting, state: State, without: Mapping[str, FittedHypothesis]) -> Worth:
    """Return what each name of the fit, and what is left, is worth.

    Args:
        asked: what was asked.
        state: at the end of the search.
        without: name to the fit without it.
    """
    found, model = state.current, asked.layout.model
    actuators = actuators_of(model, state.windows)
    costs: dict[str, Cost] = {}
    # Where nothing is there and nothing is left, there is nothing to work out.
    asked_for = asked.costs and bool(without or state.left is not None)
    whole = _errors(asked, state, found) if asked_for else None
    forces = forces_of(found, state.windows, list(without), asked.stated)
    for name, other in without.items():
        asked.say(f"asking what {name} costs")
        fall = None
        if whole is not None:
            less = _errors(asked, state, other)
            fall = None if less is None else gain(less, whole)
        share = share_of(forces[name], actuators)
        costs[name] = Cost(fall, forces[name], share, _matters(asked, fall, share))
    words = "" if whole is None else whole.how
    return Worth(costs, dict(without), _left(asked, state, actuators, whole), words)


def small(asked: Setting, state: State, left: Unnamed) -> bool:
    """Whether what is left is within the tolerance, by the upper limits of its force and its cost.

    Args:
        asked: what was asked, with the tolerance.
        state: of the search at its end.
        left: sizes of the force that no name explains.
    """
    if asked.tolerance.strict or not left.sizes:
        return False
    actuators = actuators_of(asked.layout.model, state.windows)
    upper = np.array([left.sizes[a].upper if a in left.acts_in else 0.0 for a in AXES])
    share = share_of(upper, actuators)
    if not np.isfinite(share[upper > 0]).all() or (share[upper > 0] >= asked.tolerance.force).any():
        return False
    errors = _errors(asked, state, state.current)
    if errors is None:
        return False
    floor = _floor(asked, state, errors)
    return bool(
        floor > 0 and (errors.total + ONE_SIDED * _spread(errors)) / floor - 1.0 < asked.tolerance.cost
    )


def worst(fall: Gain | None) -> Worst | None:
    """Return the velocity whose error rises most without a name, and by what share."""
    if fall is None or not fall.by_dof:
        return None
    costs = {n: _dof_cost(fall, n) for n in fall.by_dof}
    name = max(costs, key=lambda n: costs[n])
    return {"velocity": name, "cost": costs[name]}


def largest(share: Array) -> float | None:
    """Return the largest share, or None where there is none."""
    known = share[np.isfinite(share)]
    return float(known.max()) if known.size else None


def _dof_cost(fall: Gain, name: str) -> float:
    after = fall.after_by_dof.get(name, float("nan"))
    return fall.by_dof[name][0] / after if after > 0 else float("nan")


def _matters(asked: Setting, fall: Gain | None, share: Array) -> bool:
    """Whether a name costs more than is tolerated, in total or surely in one velocity, or exerts more force."""
    tolerance = asked.tolerance
    if tolerance.strict or fall is None:
        return True
    force = largest(share)
    if force is not None and force >= tolerance.force:
        return True
    return bool(not fall.cost < tolerance.cost or costs_in_one(fall, tolerance))


def costs_in_one(fall: Gain, tolerance: Tolerance) -> bool:
    """Whether a name surely costs more than is tolerated in one velocity.

    Args:
        fall: of the error that it brings.
        tolerance: what does not matter.
    """
    sure = [n for n, (value, std) in fall.by_dof.items() if value > ONE_SIDED * std]
    return any(_dof_cost(fall, n) >= tolerance.cost for n in sure)


def _errors(asked: Setting, state: State, found: FittedHypothesis) -> LeftOut | None:
    try:
        errors = left_out_found(asked.layout, found, state.windows, asked.log)
    except InputError:
        return None
    return None if errors.reason or not np.isfinite(errors.total) else errors


def _floor(asked: Setting, state: State, errors: LeftOut) -> float:
    """Return the error that a perfect model would show in the same windows."""
    model, scale = state.current.fitted.model.without_absent(), scale_of(asked.log)
    rolled = roll(model, asked.log, errors.horizon, scale)
    return float("nan") if rolled is None else noise_floor(model, rolled, asked.log, scale)


def _spread(errors: LeftOut) -> float:
    """Return the standard error of a total, over blocks of windows."""
    nothing = errors.empty()
    return gain(errors, nothing).std


def _left(asked: Setting, state: State, actuators: Array, errors: LeftOut | None) -> dict[str, Any]:
    left = state.remainder
    if left is None or not left.sizes:
        return {}
    out: dict[str, Any] = {}
    rms = np.array([left.sizes[a].rms for a in AXES])
    shares = share_of(rms, actuators)
    for k, axis in enumerate(AXES):
        size = left.sizes[axis]
        out[axis] = {
            "rms": size.rms,
            "upper": size.upper,
            "correlation_time": size.correlation_time,
            "share": float(shares[k]),
            "detectable": size.detectable,
        }
    floor = _floor(asked, state, errors) if errors is not None else float("nan")
    out["cost"] = errors.total / floor - 1.0 if errors is not None and floor > 0 else None
    return out
