"""What one row counts as: right, in a group, tied, a false name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from auvnn.studies.benchmark.cases import JOIN, NOTHING

Row = Mapping[str, Any]
# Of two explanations whose data lie d standard errors apart, the best decision there is takes the wrong one with
# probability Phi(-d/2) (Neyman and Pearson, equal prior odds). Below 3.29 that is more than 5 %: nobody can tell them
# apart with 95 % confidence. See `information`. STRICT is reported too: there even the best errs one time in six.
TIED, STRICT = 3.29, 2.0
# What the rival is called that is no effect at all.
UNSEEN = "nothing"


def kind_of(row: Row) -> str:
    """Return "effect", "several", "stranger" or "nothing"."""
    if row.get("kind"):
        return str(row["kind"])
    return "nothing" if row["hidden"] == NOTHING else "several" if JOIN in row["hidden"] else "effect"


def was_made(row: Row) -> bool:
    """Whether there was a log to diagnose: an effect may leave no trace on a manoeuvre, or a plant diverge."""
    return row.get("made") is not False


def effects_of(row: Row) -> list[str]:
    """Return the effects of the catalogue that are hidden."""
    return str(row["hidden"]).split(JOIN) if kind_of(row) in ("effect", "several") else []


def steps_of(row: Row) -> list[dict[str, Any]]:
    """Return the answer step by step: verdict and effects."""
    if row.get("found") is not None:
        return list(row["found"])
    return [{"verdict": row["verdict"], "effects": list(row["missing"])}]


def standing(row: Row) -> list[dict[str, Any]]:
    """Return the steps without the effects that a later step withdrew."""
    steps = steps_of(row)
    out = []
    for i, step in enumerate(steps):
        if step["verdict"] == "withdrawn":
            continue
        gone = {n for later in steps[i + 1 :] if later["verdict"] == "withdrawn" for n in later["effects"]}
        out.append({**step, "effects": [n for n in step["effects"] if n not in gone]})
    return out


def first_group(row: Row) -> list[str]:
    """Return the effects of the first step that stands; those that are missing where no step has any."""
    return next((s["effects"] for s in standing(row) if s["effects"]), list(row["missing"]))


def named_first(row: Row) -> bool:
    """Whether a hidden effect, and it alone, was named in the first step."""
    return row["verdict"] == "named" and bool(row["missing"]) and row["missing"][0] in effects_of(row)


def named_alone(row: Row) -> bool:
    """Whether what is hidden was named, and nothing besides."""
    return row["verdict"] == "named" and sorted(row["missing"]) == sorted(effects_of(row))


def in_group(row: Row) -> bool:
    """Whether a hidden effect was named, or is a member of a group declared ambiguous, in the first step."""
    return named_first(row) or (
        row["verdict"] == "ambiguous" and bool({*effects_of(row)} & {*row["missing"]})
    )


def tied(row: Row, effect: str, others: list[str], limit: float = TIED) -> bool:
    """Whether the log cannot tell a hidden effect from any of the others: see `information`.

    Args:
        row: of the benchmark.
        effect: that was hidden.
        others: that were named.
        limit: largest distance at which two count as alike.
    """
    distance = (row.get("plant_imitation") or row.get("imitation") or {}).get(effect) or {}
    return all(distance.get(name) is not None and distance[name] <= limit for name in others)


def unseen(row: Row, limit: float = TIED) -> bool:
    """Whether what is uncertain of the coefficients can make up for all that the one hidden effect does."""
    distance = [((row.get("imitation") or {}).get(e) or {}).get(UNSEEN) for e in effects_of(row)]
    return bool(distance) and all(d is not None and d <= limit for d in distance)


def effect_named(row: Row, effect: str) -> bool:
    """Whether a hidden effect was named in some step, or declared in a group that the log cannot tell apart.

    What was withdrawn later does not count.
    """
    for step in standing(row):
        if effect in step["effects"]:
            others = [n for n in step["effects"] if n != effect]
            return step["verdict"] == "named" or tied(row, effect, others)
    return False


def named_or_tied(row: Row, limit: float = TIED) -> bool:
    """Whether the hidden effect was named first, or is in a first group that the log cannot tell apart.

    Where it cannot be told from nothing at all, `adequate` says so.
    """
    if named_first(row):
        return True
    if row["verdict"] == "adequate":
        return unseen(row, limit)
    mine = [n for n in effects_of(row) if n in row["missing"]]
    return (
        row["verdict"] == "ambiguous"
        and bool(mine)
        and all(tied(row, mine[0], [n], limit) for n in first_group(row) if n != mine[0])
    )


def all_named(row: Row) -> bool:
    """Whether every hidden effect was named, or declared in a group that the log cannot tell apart."""
    return bool(effects_of(row)) and all(effect_named(row, effect) for effect in effects_of(row))


def all_shown_named(row: Row) -> bool:
    """Whether the same holds of every hidden effect that the log can show at all: see `unseen`.

    Where it can show none of them, `adequate` is right.
    """
    shown = [e for e in effects_of(row) if not tied(row, e, [UNSEEN])]
    return all(effect_named(row, e) for e in shown) if shown else row["verdict"] == "adequate"


def given_names(row: Row) -> list[str]:
    """Return the names that the answer gives; members of a declared group, and what it withdrew, are none."""
    return [n for step in standing(row) if step["verdict"] == "named" for n in step["effects"]]


def false_names(row: Row) -> list[str]:
    """Return the names that were given and are not hidden."""
    return [n for n in given_names(row) if n not in effects_of(row)]


def false_share(row: Row) -> float:
    """Return the share of the given names that are false, none given counting as none false."""
    given = given_names(row)
    return len(false_names(row)) / len(given) if given else 0.0


def right_verdict(row: Row) -> bool:
    """Whether the verdict is one that is right where nothing can be named: adequate; unknown, or partial."""
    right = {"nothing": ("adequate",), "stranger": ("unknown", "partial")}
    return row["verdict"] in right.get(kind_of(row), ())


def right_axis(row: Row) -> bool:
    """Whether the degree of freedom that was said to hold the unknown is the one in which it mostly acts."""
    return row.get("axis") is not None and row.get("axis") in (row.get("axes_true") or [])


def answer_of(row: Row) -> str:
    """Return what was answered in the first step: the first name, or the verdict where none was given."""
    return row["missing"][0] if row["verdict"] == "named" and row["missing"] else row["verdict"]


def wrapped(gap: float, unit: str | None) -> float:
    """Return how far a value is from another one: of angles the shorter way round.

    Args:
        gap: their difference.
        unit: of both.
    """
    return math.remainder(gap, 2.0 * math.pi) if unit == "rad" else gap


def wrapped_error(row: Row, name: str, z: float) -> float:
    """Return an error in standard errors, of an angle the shorter way round.

    Args:
        row: of the benchmark.
        name: of the parameter, with its effect's where several are hidden.
        z: the error.
    """
    effect, _, own = name.partition(".") if kind_of(row) == "several" else ("", "", name)
    known = row.get("parameters") or {}
    found = (known.get(effect) or {} if effect else known).get(own) or {}
    return wrapped(z * found["std"], found.get("unit")) / found["std"] if found.get("std") else z
