"""What refitting the stated coefficients brings, beside the names.

A model that is adequate within the uncertainties of its coefficients may predict badly with the values in its file: the
log then moves them within what was stated of them, and no effect has to be named. What that brings is told, for it may be
where the model is wrong above all, whatever has a name beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from auvnn.answer_types import EffectCost, RefittedCoefficients
from auvnn.diagnosis.answers.effect_costs import costs_in_one
from auvnn.diagnosis.answers.moved_coefficients import in_words, moved_beyond
from auvnn.diagnosis.cross_validation.errors import gain
from auvnn.diagnosis.cross_validation.left_out import left_out_by, left_out_found
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.rounds.free_running_cost import as_stated
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.errors import InputError
from auvnn.models import GreyBox

# Standard errors by which the error must fall, and stated standard deviations from which on a coefficient is told.
SURELY, AWAY = 2.0, 1.0


def refitted_coefficients(asked: Setting, state: State) -> RefittedCoefficients | None:
    """Return by how much free running on what is left out gains by the coefficients; None where that does not matter.

    Nothing is said where something without a name is left: the coefficients take up what they can of it. Nor where
    damping was learned: what stands for that in a diagnosis is not what the file states.

    Args:
        asked: what was asked.
        state: where the search ended.
    """
    found, nuisance = state.current, asked.layout.nuisance
    told = state.steps[0]["verdict"] not in ("unknown", "partial") and state.steps[-1]["verdict"] != "unknown"
    if not told or not asked.costs or asked.tolerance.strict or not nuisance or "learned_drag" in nuisance:
        return None
    asked.say("asking what refitting the stated coefficients brings")
    try:
        before = [left_out_by(lambda _, m=model: m, asked.log) for model in _as_stated(asked, found)]
        after = left_out_found(asked.layout, found, state.windows, asked.log)
    except (InputError, np.linalg.LinAlgError, FloatingPointError):
        # The verdict did not need it: a log too short to leave a part of it out has none.
        return None
    best = min(before, key=lambda errors: errors.total)
    if best.horizon != after.horizon:
        return None
    # Without a figure for either there is no fall that is sure.
    fall = gain(best, after)
    matters = fall.cost >= asked.tolerance.cost or costs_in_one(fall, asked.tolerance)
    if not (fall.beyond(SURELY) and matters):
        return None
    vehicle = asked.model.vehicle
    return {
        "before": fall.before,
        "after": fall.after,
        "horizon": float(best.horizon),
        "gain": {"value": fall.value, "std": fall.std},
        "coefficients": moved_beyond(asked.layout, found, AWAY),
        "command": "" if vehicle.reduced or vehicle.glides else "auvnn improve",
    }


def _as_stated(asked: Setting, found: FittedHypothesis) -> Sequence[GreyBox]:
    """Return the model with its coefficients as stated: the names as they were fitted, and following the coefficients.

    Names that were fitted beside other coefficients may be wrong beside these: whichever predicts better counts.
    """
    if not found.effects:
        return [asked.model]
    return as_stated(asked.layout, found, [n for n in found.names if n not in found.effects])


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
    most = in_words(found["coefficients"])
    names = f" (in brackets by how many of their stated standard deviations): {most}" if most else ""
    with_names, begin = "", "That holds with the stated coefficients refitted"
    if matters is not None:
        with_names = ", with what is named,"
        begin = (
            f"{'Above all' if above_all(found, matters) else 'Beside that'} the stated coefficients are off"
        )
    how = f"; `{found['command']}` makes that model" if found["command"] else ""
    return [
        f"{begin}{names}. With the values of its file the model{with_names} errs by {found['before']:.3g} over "
        f"{found['horizon']:g} s of free running, refitted by {found['after']:.3g} on what was left out{how}."
    ]


def above_all(found: RefittedCoefficients | None, matters: Mapping[str, EffectCost]) -> bool:
    """Whether refitting the coefficients is known to bring more than each name does.

    Args:
        found: from `refitted_coefficients`.
        matters: what each name costs.
    """
    gains = [c["gain"]["value"] if c["gain"] is not None else float("nan") for c in matters.values()]
    return found is not None and bool(gains) and all(found["gain"]["value"] > value for value in gains)
