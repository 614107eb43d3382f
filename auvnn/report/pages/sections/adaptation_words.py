"""Sentences on an online adaptation that its page and the command say alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report.words import finite, number, percent

# Of the error: less than this is no difference, and so much taken away by learning is a model that was off.
EQUAL, OFF = 0.02, 0.15


def ratio_words(ratio: float) -> str:
    """Return how the error with what was learned stands to that of the model as it was."""
    if abs(ratio - 1.0) <= EQUAL:
        return "the error is the same as that of the model as it was"
    if ratio < 1.0:
        return f"the error is {percent(1.0 - ratio)} smaller than that of the model as it was"
    return f"the error is larger than that of the model as it was, {number(ratio, 3)} times"


def worse_words(ratio: float | None) -> list[str]:
    """Return what to do where what was learned predicts worse than the model as it was; nothing elsewhere."""
    if ratio is None or not ratio > 1.0 + EQUAL:
        return []
    return [
        "Do not go on with these weights: what the model lacks is not damping alone. auvnn diagnose, with the same "
        "model and log, asks what it is."
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
        f"The model was off from the beginning: learning takes up to {percent(max(gained))} of its error away. What it "
        "lacks, auvnn diagnose asks with the same model and log; damping that is adapted hides it."
    ]
