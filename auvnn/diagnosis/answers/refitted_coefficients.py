"""What refitting the stated coefficients brings, beside the names.

A model that is adequate within the uncertainties of its coefficients may predict badly with the values in its file: the
log then moves them within what was stated of them, and no effect has to be named. What that brings is told, for it may be
where the model is wrong above all, whatever has a name beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from auvnn.answer_types import EffectCost, MovedCoefficient, RefittedCoefficients
from auvnn.diagnosis.answers.effect_costs import costs_in_one
from auvnn.diagnosis.answers.moved_coefficients import told_as, within
from auvnn.diagnosis.cross_validation.errors import gain
from auvnn.diagnosis.cross_validation.fitters import at
from auvnn.diagnosis.cross_validation.left_out import left_out_by, left_out_found
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.errors import InputError
from auvnn.models import GreyBox

# Standard errors by which the error must fall, and stated standard deviations from which on a coefficient is told.
SURELY, AWAY = 2.0, 1.0
NAMED = 6


def refitted_coefficients(asked: Setting, state: State) -> RefittedCoefficients | None:
    """Return by how much free running on what is left out gains by the coefficients; None where that does not matter.

    Args:
        asked: what was asked.
        state: where the search ended.
    """
    found = state.current
    if not asked.costs or not asked.layout.nuisance or asked.tolerance.strict:
        return None
    asked.say("asking what refitting the stated coefficients brings")
    try:
        before = left_out_by(lambda _: _as_stated(asked, found), asked.log)
        after = left_out_found(asked.layout, found, state.windows, asked.log)
    except (InputError, np.linalg.LinAlgError, FloatingPointError):
        # The verdict did not need it: a log too short to leave a part of it out has none.
        return None
    if before.reason or after.reason or before.horizon != after.horizon:
        return None
    fall = gain(before, after)
    matters = fall.cost >= asked.tolerance.cost or costs_in_one(fall, asked.tolerance)
    if not (fall.beyond(SURELY) and matters):
        return None
    return {
        "before": fall.before,
        "after": fall.after,
        "horizon": float(before.horizon),
        "gain": {"value": fall.value, "std": fall.std},
        "coefficients": within(asked.layout, found, AWAY),
    }


def _as_stated(asked: Setting, found: FittedHypothesis) -> GreyBox:
    """Return the model with the names as they were fitted, and its coefficients as they were stated."""
    if not found.effects:
        return asked.model
    theta = found.fitted.theta.copy()
    for name, own in asked.layout.places(found.names).items():
        if name not in found.effects:
            theta[own] = asked.layout.means[name]
    return at(asked.layout, found.names, theta).without_absent()


def refitted_words(
    found: RefittedCoefficients | None, matters: Mapping[str, EffectCost] | None = None
) -> list[str]:
    """Return that in words, one sentence or none.

    Args:
        found: from `refitted_coefficients`.
        matters: what each name costs; None where nothing has a name.
    """
    if found is None:
        return []
    most = _furthest(found["coefficients"])
    names = f": {', '.join(most)}" if most else ""
    with_names, begin = "", "That holds with the stated coefficients refitted within their uncertainties"
    if matters is not None:
        with_names = ", with what is named,"
        begin = (
            f"{'Above all' if above_all(found, matters) else 'Beside that'} the stated coefficients are off"
        )
        begin += ", within their uncertainties"
    return [
        f"{begin}{names}. With the values of its file the model{with_names} errs by {found['before']:.3g} over "
        f"{found['horizon']:g} s of free running, refitted by {found['after']:.3g} on what was left out; `auvnn improve` "
        "makes that model."
    ]


def above_all(found: RefittedCoefficients | None, matters: Mapping[str, EffectCost]) -> bool:
    """Whether refitting the coefficients brings more than each name does.

    Args:
        found: from `refitted_coefficients`.
        matters: what each name costs.
    """
    gains = [cost["gain"]["value"] for cost in matters.values() if cost["gain"] is not None]
    return found is not None and all(found["gain"]["value"] > value for value in gains)


def _furthest(moved: Sequence[MovedCoefficient]) -> list[str]:
    """Return the coefficients that went furthest, each in words, and how many more there are."""
    more = [f"and {len(moved) - NAMED} more"] if len(moved) > NAMED else []
    return [*(told_as(m) for m in moved[:NAMED]), *more]
