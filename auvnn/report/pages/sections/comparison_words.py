"""The sentences of the comparison's page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report import style
from auvnn.report.pages import common
from auvnn.report.view import View
from auvnn.report.words import finite, number, percent


def verdict(horizon: str, error: float, held: float | None) -> str:
    """Return how the model compares with holding the initial velocity."""
    words = f"Running free for {horizon}, the model's error is {percent(error)} of the spread of the motion"
    if held is None:
        return f"{words}."
    beside = f"simply holding the initial velocity would give {percent(held)}"
    if error < 0.95 * held:
        return f"{words}; {beside}. The model predicts."
    if error <= 1.05 * held:
        return f"{words}; {beside}. The model is no better than none."
    return f"{words}; {beside}. The model is worse than none."


def one_step_words(one_step: Mapping[str, Any]) -> list[str]:
    """Return the range of R² one step ahead."""
    known = {k: r for k, e in one_step.items() if (r := finite(e.get("r2"))) is not None}
    if len(known) < 2:
        return []
    low, high = min(known, key=lambda k: known[k]), max(known, key=lambda k: known[k])
    words = [f"{number(known[k], 2)} in {common.channel_words(k).split(' ')[0]}" for k in (low, high)]
    return [f"One step ahead, R² of the acceleration lies between {words[0]} and {words[1]}."]


def largest(residual: Mapping[str, Any]) -> tuple[str, float] | None:
    """Return the axis whose residual stands out most, and its ratio to the noise floor."""
    ratios = {
        k: rms / floor
        for k, e in residual.items()
        if (rms := finite(e.get("rms"))) is not None and (floor := finite(e.get("noise_floor")))
    }
    name = max(ratios, key=lambda k: ratios[k], default=None)
    return None if name is None else (name, ratios[name])


def residual_words(residual: Mapping[str, Any]) -> list[str]:
    """Return what the model lacks most."""
    found = largest(residual)
    if found is None:
        return []
    name, ratio = found
    unit = dict(style.WRENCH).get(name, "N")
    rms = f"{number(finite(residual[name].get('rms')))} {unit}"
    if ratio <= 1.5:
        return [
            f"What the model lacks is close to sensor noise everywhere; at most {number(ratio, 2)} times, in "
            f"{name}."
        ]
    return [
        f"What it lacks stands out most in {common.channel_words(name)}: {rms} rms, {number(ratio, 2)} times "
        "the noise floor."
    ]


def failure_words(view: View) -> list[str]:
    """Return where the error sits first of all."""
    found = [f for f in view.items("failures") if isinstance(f, Mapping)]
    if not found:
        return []
    first = found[0]
    share = f" ({percent(first.get('share'))} of the error)" if finite(first.get("share")) else ""
    words = (
        f"The error sits first of all in {common.channel_words(first.get('channel'))}: {where(first)}{share}"
    )
    place = next(
        (f for f in found if f.get("channel") == first.get("channel") and where(f) != "everywhere"), None
    )
    return [f"{words}; there look at {where(place)}." if place not in (None, first) else f"{words}."]


def where(failure: Any) -> str:
    """Return the place in words, without the motion, which the channel says already."""
    where = str(failure.get("where") or "everywhere")
    motion = common.channel_words(failure.get("channel")).split(" ")[0]
    return where.removeprefix(f"{motion}, ")
