"""Counting in worlds that break the model's assumptions: what was visible, what is true anyway, what counts as wrong.

A hidden effect is *visible* where an oracle that knows the world's law sees it at five standard errors or more and it
costs a tenth of the 5 s error or more. Names that are true in a world itself count neither as hits nor as errors.
`partial` never counts as named, and a wrong first name in it counts as wrong, as does a group that holds nothing true.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.studies.benchmark.counts import counting
from auvnn.studies.benchmark.counts.counting import Row, effects_of, kind_of

# Standard errors at which an oracle must see an effect, and the least cost, for it to count as visible.
SEEN, LEAST_COST = 5.0, 0.10
# How far the force that is left may be off: share of its rms, factor of its correlation time.
RMS, MEMORY = 0.2, 2.0
# A force below this share of the largest of its kind is not asked about.
SMALL = 0.05


def neutral(row: Row) -> set[str]:
    """Return the names that are true in the row's world with nothing hidden, those that are hidden aside."""
    return {*((row.get("world_law") or {}).get("true_names") or ())} - {*effects_of(row)}


def stripped(row: Row) -> dict[str, Any]:
    """Return the row without the names that are true in its world itself.

    A step or an answer of which nothing is left says nothing that could be right or wrong: `adequate`.
    """
    spare = neutral(row)
    out = dict(row)
    if not spare:
        return out
    steps = []
    for step in counting.steps_of(row):
        left = [n for n in step["effects"] if n not in spare]
        if left or not step["effects"]:
            verdict = "named" if step["verdict"] == "ambiguous" and len(left) == 1 else step["verdict"]
            steps.append({"verdict": verdict, "effects": left})
    out["found"] = steps
    out["missing"] = [n for n in row["missing"] if n not in spare]
    out["nearest"] = [n for n in row.get("nearest") or [] if n not in spare]
    if row["verdict"] in ("named", "ambiguous"):
        # What a later step withdrew was not given.
        stay = [s for s in counting.standing(out) if s["effects"] and s["verdict"] in ("named", "ambiguous")]
        out["verdict"] = stay[0]["verdict"] if stay else "adequate"
        if row["verdict"] == "ambiguous" and not out["missing"]:
            # What is missing are the members of the first group. Where all of them are true, the next step comes first.
            out["missing"] = list(stay[0]["effects"]) if stay else []
    return out


def visible(row: Row) -> bool:
    """Whether an oracle sees the hidden effect, and it costs enough to be asked for."""
    seen, cost = seen_at(row), row.get("cost")
    return seen is not None and seen >= SEEN and cost is not None and cost >= LEAST_COST


def seen_at(row: Row) -> float | None:
    """Return by how many standard errors an oracle sees the hidden effect, or None where nobody asked it."""
    names = effects_of(row)
    return ((row.get("oracle_distances") or {}).get(names[0]) or {}).get(counting.UNSEEN) if names else None


def _told(row: Row) -> dict[str, Any]:
    """Return the row without neutral names, the oracle's distances being what ties are judged by."""
    out = stripped(row)
    if row.get("oracle_distances"):
        out["imitation"], out["plant_imitation"] = row["oracle_distances"], None
    return out


def right(row: Row) -> bool:
    """Whether the hidden effect was named first, or is in a first group that the oracle cannot tell apart either."""
    told = _told(row)
    if told["verdict"] in ("partial", "adequate", "unknown", "fault"):
        return False
    return counting.named_or_tied(told)


def alone(row: Row) -> bool:
    """Whether the hidden effect was named first, and alone in its step."""
    return counting.named_first(_told(row))


def wrong_first(row: Row) -> bool:
    """Whether what is said first is wrong: a name, a group that holds nothing true, the first of a partial answer."""
    told, hidden = stripped(row), effects_of(row)
    if told["verdict"] == "named":
        return bool(told["missing"]) and told["missing"][0] not in hidden
    if told["verdict"] == "ambiguous":
        return not {*counting.first_group(told)} & {*hidden}
    if told["verdict"] == "partial":
        near = told.get("nearest") or []
        return bool(near) and near[0] not in hidden
    return False


def false_names(row: Row) -> list[str]:
    """Return the names that were given and are neither hidden nor true in the world itself."""
    return counting.false_names(stripped(row))


def false_share(row: Row) -> float:
    """Return the share of false names among those given, neutral ones aside."""
    return counting.false_share(stripped(row))


def silent(row: Row) -> bool:
    """Whether no name is given but such as are true in the world itself; the first of a partial answer is one."""
    told = stripped(row)
    groups = [s for s in counting.steps_of(told) if s["verdict"] == "ambiguous" and s["effects"]]
    return not counting.given_names(told) and not groups and not wrong_first(row)


def adequate(row: Row) -> bool:
    """Whether nothing is missed where nothing is hidden, or nothing but what is true in the world itself."""
    return stripped(row)["verdict"] == "adequate"


def force_right(row: Row) -> list[bool]:
    """Return of each degree of freedom that is disturbed whether the force left has the right rms and memory."""
    truth, found = ((row.get("world_law") or {}).get("drawn") or {}).get("force"), row.get("left")
    if not truth or not found:
        return []
    rms = np.array(truth["rms"])
    # Forces and moments apart: newtons and newton metres are not compared.
    largest = np.repeat([rms[:3].max(), rms[3:].max()], 3)
    out = []
    for i, axis in enumerate("XYZKMN"):
        if rms[i] <= 0.0 or rms[i] < SMALL * largest[i]:
            continue
        said = found.get(axis) or {}
        size, memory = said.get("rms"), said.get("correlation_time")
        ratio = (memory or 0.0) / truth["correlation"][i]
        out.append(size is not None and abs(size / rms[i] - 1.0) <= RMS and 1.0 / MEMORY <= ratio <= MEMORY)
    return out


def own_amounts(row: Row) -> dict[str, float]:
    """Return how much of the hidden effect the row's world has by itself, by parameter; empty where that is not known.

    A vertical that is off in a world and a hidden tilt are one rotation after the other: of small angles the
    rotation vectors add up. The exponents that a world gives the drag and hidden ones are powers of the same ratio of
    speeds, and add up less the square's two. What a log can tell is the sum.
    """
    drawn = (row.get("world_law") or {}).get("drawn") or {}
    tilt, exponent = drawn.get("tilt"), drawn.get("exponent")
    if effects_of(row) == ["tilted_vertical"] and tilt:
        return dict(zip(("north", "east"), map(float, tilt), strict=True))
    if effects_of(row) == ["drag_curve"] and exponent:
        return {axis: float(e) - 2.0 for axis, e in zip("XYZKMN", exponent, strict=True)}
    return {}


def _asked(rows: Sequence[Row], kind: str) -> list[Row]:
    return [r for r in rows if kind_of(r) == kind and counting.was_made(r) and r.get("world")]


def _of_world(rows: Sequence[Row]) -> list[Row]:
    return [
        r for r in rows if counting.was_made(r) and r.get("world") and kind_of(r) in ("effect", "nothing")
    ]


RATES: Mapping[str, Any] = {
    "visible": lambda rows: [visible(r) for r in _asked(rows, "effect") if seen_at(r) is not None],
    "visible_named_or_tied": lambda rows: [right(r) for r in _asked(rows, "effect") if visible(r)],
    "visible_named_alone": lambda rows: [alone(r) for r in _asked(rows, "effect") if visible(r)],
    "wrong_first": lambda rows: [wrong_first(r) for r in _of_world(rows)],
    "adequate_in_world": lambda rows: [adequate(r) for r in _asked(rows, "nothing")],
    "no_name_in_world": lambda rows: [silent(r) for r in _asked(rows, "nothing")],
    "left_force": lambda rows: [right for r in _asked(rows, "nothing") for right in force_right(r)],
}
"""Shares of logs with a world, by name; see `rates`."""

NUMBERS: Mapping[str, Any] = {
    "false_discovery_in_world": lambda rows: [
        false_share(r) for r in _of_world(rows) if r["verdict"] != "fault"
    ],
}
