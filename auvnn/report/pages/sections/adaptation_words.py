"""Sentences on an online adaptation that its page and the command say alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from auvnn.report.words import finite, number, percent

# Of the error: less than this is no difference, and so much taken away by learning is a model that was off.
EQUAL, OFF = 0.02, 0.15
EARLY = 5.0  # s after the beginning, within which a change can be a model that never fitted


def ratio_words(ratio: float) -> str:
    """Return how the error with what was learned compares with that of the model before it learned."""
    if abs(ratio - 1.0) <= EQUAL:
        return "the error is the same as that of the model without adaptation"
    if ratio < 1.0:
        return f"the error is {percent(1.0 - ratio)} smaller than that of the model without adaptation"
    if ratio < 2.0:
        return f"the error is {percent(ratio - 1.0)} larger than that of the model without adaptation"
    return f"the error is {number(ratio, 2)} times that of the model without adaptation"


def worse_words(ratio: float | None) -> list[str]:
    """Return what to do where what was learned predicts worse than the model without it; nothing elsewhere."""
    if ratio is None or not ratio > 1.0 + EQUAL:
        return []
    return [
        "Do not go on with these weights: what the model lacks is not damping alone. auvnn diagnose, with the same "
        "model and log, asks what it is."
    ]


def early_words(changes: Sequence[Mapping[str, Any]], history: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what else a change at the very beginning can mean; nothing where none was seen there.

    Before the first change nothing was learned of the vehicle: a model that is wrong from the start looks the same.

    Args:
        changes: {run, time}, s, in their order.
        history: {run, t} of each run, s.
    """
    if not changes or not history:
        return []
    first, run = changes[0], history[0]
    t = run.get("t")
    begin = finite(t[0]) if isinstance(t, (list, tuple)) and t else None
    at = finite(first.get("time"))
    if begin is None or at is None or first.get("run") != run.get("run") or at - begin > EARLY:
        return []
    return [
        f"The first change was seen within {number(EARLY, 1)} s of the beginning: it can as well be a model that was "
        "wrong from the start. auvnn diagnose, with the same model and log, asks what it lacks."
    ]


def off_words(metrics: Mapping[str, Any]) -> list[str]:
    """Return what it means that learning changed much while no change of the vehicle was seen; nothing elsewhere."""
    ratio = finite(metrics.get("frozen_5_s_error_ratio"))
    one_step = []
    for key, value in metrics.items():
        if key.startswith("one_step_rmse") and key.endswith("_unadapted") and (before := finite(value)):
            after = finite(metrics.get(key.removesuffix("_unadapted") + "_adapted"))
            one_step += [] if after is None else [after / before]
    # The error one step ahead counts by the axis in which the model was off most.
    gained = [1.0 - r for r in ([] if ratio is None else [ratio]) + ([min(one_step)] if one_step else [])]
    if not gained or max(gained) < OFF:
        return []
    return [
        f"The model was wrong from the beginning: learning removes up to {percent(max(gained))} of its error. auvnn "
        "diagnose, with the same model and log, asks what it lacks; adapted damping only hides it."
    ]
