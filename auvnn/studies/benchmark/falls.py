"""How far the held-out error falls with what was found, compared with what the truth gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.put_into_model import with_fitted_parameters
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.errors import AuvnnError
from auvnn.improvement import add
from auvnn.improvement.gains import paired_gain
from auvnn.logs import Log
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import with_commands

HORIZON = "5"
# A true fall below this many of its own standard errors is nothing to take a share of.
CLEAR = 2.0


def names_to_add(steps: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what whoever believes a diagnosis adds: the names, and of a declared group the first."""
    out: list[str] = []
    for step in steps:
        effects = list(step["effects"])
        out += effects[:1] if step["verdict"] == "ambiguous" else effects
    return list(dict.fromkeys(out))


def fall(model: GreyBox, true: GreyBox, log: Log, held_out: Log, names: Sequence[str]) -> dict[str, Any]:
    """Return the errors of 5 s of free running on runs held out, and the fall as a share of the true one.

    Args:
        model: nominal.
        true: the same with the hidden effects and the plant's coefficients, all at their true values.
        log: what was diagnosed; the coefficients, and the effects if any, are refitted on it.
        held_out: further runs of the same plant.
        names: effects that were found.

    Returns:
        `refitted`: error of the nominal model, its coefficients refitted; `found`: with the effects found, all
        refitted; `true`: of the truth; `share`: (refitted - found) / (refitted - true), None where the truth's own
        fall is within twice its standard error; `std` of the true fall; `fault`: why there is none of it, or None.
    """
    try:
        before, after = _fitted(model, log, held_out, names)
        scale = scale_of(held_out)
        # The truth is driven as the fitted model is: what commands do between samples is no part of the question.
        alike = with_commands(true, after.commands)
        rolled = [roll(m, held_out, HORIZON, scale) for m in (before, after, alike)]
    except AuvnnError as problem:
        return {
            "refitted": None,
            "found": None,
            "true": None,
            "share": None,
            "std": None,
            "fault": str(problem),
        }
    kept = [r for r in rolled if r is not None]
    if len(kept) < len(rolled):
        words = f"no held-out run is {HORIZON} s long"
        return {"refitted": None, "found": None, "true": None, "share": None, "std": None, "fault": words}
    refitted, found, perfect = (r.total(scale) for r in kept)
    gain, std = paired_gain(kept[0], kept[2], scale)
    share = (refitted - found) / gain if gain > CLEAR * std else None
    return {
        "refitted": refitted, "found": found, "true": perfect, "share": share, "std": std, "fault": None,
    }  # fmt: skip


def _fitted(model: GreyBox, log: Log, held_out: Log, names: Sequence[str]) -> tuple[GreyBox, GreyBox]:
    """Return the nominal model with its coefficients refitted, and the one with the effects in it."""
    if names:
        improved = add(model, log, list(names), test=held_out, horizons=(HORIZON,), refit=True)
        return improved.refitted_model, improved.model
    layout = lay_out(model, [])
    alone = with_fitted_parameters(
        model, layout, fit_hypothesis(layout, windows_for(model, log), list(layout.names), ())
    )
    return alone, alone
