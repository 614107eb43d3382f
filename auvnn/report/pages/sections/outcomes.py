"""The logs of a benchmark, read without trusting them, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.report.plots.confusion import OUTCOMES
from auvnn.report.view import View
from auvnn.report.words import finite

Row = Mapping[str, Any]
NOTHING = "nothing"
JOIN = "+"
KINDS = ("effect", "several", "stranger", "nothing")
CONDITION = ("vehicle", "noise", "excitation")


def rows_of(view: View) -> list[Row]:
    """Return the logs, one row each."""
    return [r for r in view.items("rows") if isinstance(r, Mapping)]


def text(row: Row, key: str, unknown: str = "?") -> str:
    """Return one entry that is a text.

    Args:
        row: of the benchmark.
        key: of the entry.
        unknown: what stands where there is none.
    """
    value = row.get(key)
    return value if isinstance(value, str) and value else unknown


def names(row: Row) -> list[str]:
    """Return the effects that were named, or that a declared group holds."""
    found = row.get("missing")
    return [m for m in found if isinstance(m, str)] if isinstance(found, (list, tuple)) else []


def answer(row: Row) -> str:
    """Return what was answered in the first step: the first name, or the verdict where none was given."""
    given = names(row) if text(row, "verdict") == "named" else []
    return given[0] if given else text(row, "verdict")


def kind(row: Row) -> str:
    """Return what kind of thing is hidden: one effect, several, a stranger to the catalogue, or nothing."""
    if text(row, "kind") in KINDS:
        return text(row, "kind")
    return "nothing" if text(row, "hidden") == NOTHING else "effect"


def right(row: Row) -> bool:
    """Whether the hidden effect, and it alone, was named first; with nothing, and a stranger, whether none was.

    Of several, whether all were named and nothing else.
    """
    if kind(row) in ("nothing", "stranger"):
        return text(row, "verdict") == {"nothing": "adequate", "stranger": "unknown"}[kind(row)]
    if kind(row) == "several":
        return text(row, "verdict") == "named" and {*names(row)} == {*text(row, "hidden").split(JOIN)}
    return text(row, "verdict") == "named" and answer(row) == text(row, "hidden")


def in_group(row: Row) -> bool:
    """Whether a group was declared that holds the hidden effect."""
    return text(row, "verdict") == "ambiguous" and text(row, "hidden") in names(row)


def flawless(row: Row) -> bool:
    """Whether the answer is right and no further name was given."""
    hidden = {"nothing": 0, "stranger": 0, "effect": 1}
    return right(row) and (kind(row) == "several" or len(names(row)) <= hidden[kind(row)])


def of_kind(rows: Sequence[Row], wanted: str) -> list[Row]:
    """Return the logs that hide one effect, several, a stranger or nothing; one that was not made is none."""
    return [r for r in rows if kind(r) == wanted and r.get("made") is not False]


def with_effect(rows: Sequence[Row]) -> list[Row]:
    """Return the logs that hide one effect."""
    return of_kind(rows, "effect")


def with_nothing(rows: Sequence[Row]) -> list[Row]:
    """Return the logs that hide nothing."""
    return of_kind(rows, "nothing")


def values(rows: Sequence[Row], key: str) -> list[str]:
    """Return the texts that an entry takes, each once, in their order."""
    return list(dict.fromkeys(r[key] for r in rows if text(r, key, "")))


def numbers(rows: Sequence[Row], key: str) -> list[float]:
    """Return the numbers that an entry takes, each once, rising."""
    return sorted({value for r in rows if (value := finite(r.get(key))) is not None})


def by_condition(rows: Sequence[Row]) -> dict[tuple[str, ...], list[Row]]:
    """Return the logs of each vehicle, noise and manoeuvre."""
    out: dict[tuple[str, ...], list[Row]] = {}
    for r in rows:
        out.setdefault(tuple(text(r, k) for k in CONDITION), []).append(r)
    return out


def errors(rows: Sequence[Row], key: str) -> NDArray[np.float64]:
    """Return one number of every parameter of the logs in which the hidden effect was named first."""
    entries = [e for r in with_effect(rows) if right(r) and isinstance(r.get("errors"), Mapping)
               for e in r["errors"].values() if isinstance(e, Mapping)]  # fmt: skip
    return np.array([value for e in entries if (value := finite(e.get(key))) is not None])


def confusion_counts(rows: Sequence[Row]) -> tuple[list[str], list[str], NDArray[np.float64]]:
    """Return what was hidden (n), what was answered (m), and how many logs (n, m).

    Logs that hide several effects are not in it: their first answer is only a part of theirs.
    """
    rows = [r for r in rows if kind(r) != "several" and r.get("made") is not False]
    hidden = list(dict.fromkeys(text(r, "hidden") for r in with_effect(rows)))
    given = [a for a in dict.fromkeys(map(answer, rows)) if a not in hidden and a not in OUTCOMES]
    columns = [*hidden, *given, *OUTCOMES]
    lines = [*hidden, *strangers(rows), *([NOTHING] if with_nothing(rows) else [])]
    counts = Counter((text(r, "hidden"), answer(r)) for r in rows)
    table = np.array([[counts[h, c] for c in columns] for h in lines], dtype=float)
    return lines, columns, table.reshape(len(lines), len(columns))


def size_words(rows: Sequence[Row]) -> str:
    """Return what the sizes of hidden effects are measured in, as a sentence; empty where that is not known."""
    sizes = [part for size in values(with_effect(rows), "size") for part in size.split(JOIN)]
    shares = [size.endswith("%") for size in sizes]
    if shares and all(shares):
        return "Sizes: how much of the 5 s error of free running the hidden effect causes."
    if shares and not any(shares):
        return "Sizes are in standard errors of a fit that knows everything else."
    return ""


def strangers(rows: Sequence[Row]) -> list[str]:
    """Return the names of what is hidden that the catalogue has no name for."""
    return values(of_kind(rows, "stranger"), "hidden")


def shares_of_fall(rows: Sequence[Row]) -> dict[str, dict[str, list[float]]]:
    """Return {effect: {size: shares of the true fall of the held-out error}}; several effects are "several"."""
    out: dict[str, dict[str, list[float]]] = {}
    for r in rows:
        found = r.get("fall")
        share = finite(found.get("share")) if isinstance(found, Mapping) else None
        if share is not None and kind(r) in ("effect", "several"):
            name = text(r, "hidden") if kind(r) == "effect" else "several"
            size = text(r, "size") if kind(r) == "effect" else "mixed"
            out.setdefault(name, {}).setdefault(size, []).append(share)
    return out


def found_by_size(rows: Sequence[Row]) -> dict[str, dict[str, tuple[int, int]]]:
    """Return {effect: {size: (logs in which it was named first, logs)}}."""
    out: dict[str, dict[str, tuple[int, int]]] = {}
    for r in with_effect(rows):
        sizes = out.setdefault(text(r, "hidden"), {})
        named, logs = sizes.get(text(r, "size"), (0, 0))
        sizes[text(r, "size")] = (named + right(r), logs + 1)
    return out
