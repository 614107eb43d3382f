"""What a mapping asks of a recording: which paths, how often, and what it will not ask for again."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.recording import PRIMARY, Asked, Recording, Topic, base_name, topic_of

Array = NDArray[np.float64]

_NUMBERED = ("thruster", "fin")


def asked_of(plan: Mapping) -> Asked:
    """Return the topics and fields that a mapping needs."""
    column = plan.columns.get("t")
    time = [] if column is None or column.source is None else [column.source]
    return Asked(frozenset(uses(plan)), frozenset(p.rsplit(".", 1)[-1] for p in time))


def lacking(recording: Recording, asked: Asked) -> bool:
    """Say whether a topic has not every field that is asked of it."""
    return any(
        path.startswith(f"{topic.name}.") and path[len(topic.name) + 1 :] not in topic.columns
        for path in asked.paths
        for topic in recording.topics.values()
    )


def uses(plan: Mapping) -> Counter[str]:
    """Return the paths of a recording that a mapping takes values from, and how often."""
    found: Counter[str] = Counter()
    if plan.run not in (None, "file"):
        found[str(plan.run)] += 1
    for column in plan.columns.values():
        each = [column.source, column.more.over, *column.cores, column.by]
        each += [c for c, _ in column.more.mix]
        each += [column.valid.source] if column.valid else []
        found.update(p for p in each if p)
        if column.source and f"[{PRIMARY}]" in column.source:
            found.update(f"{base_name(topic_of(column.source))[:-1]}{n}.PI" for n in "4")
    return found


def alike(name: str, plan: Mapping) -> tuple[str, ...]:
    """Return the columns that are best taken with one: of a thruster or fin all of them, as far as they are plain."""
    kind = name.rsplit("_", 1)[0]
    if kind not in _NUMBERED:
        return (name,)
    mine = {n: c.more for n, c in plan.columns.items() if n.rsplit("_", 1)[0] == kind}
    plain = tuple(n for n, more in mine.items() if not more.difference and more.over is None)
    return plain if name in plain else (name,)


def joined(found: list[tuple[str, Topic, Array]]) -> list[list[tuple[str, Topic, Array]]]:
    """Return commands in one group where none is missing: a missing one is filled from its own last message."""
    each = found[0][0].rsplit("_", 1)[0] in _NUMBERED and any(not np.isfinite(v).all() for _, _, v in found)
    return [[one] for one in found] if each else [list(found)]


class Spare:
    """Columns of a recording that nothing will ask for again."""

    def __init__(self, recording: Recording, plan: Mapping) -> None:
        self.recording, self.left = recording, uses(plan)
        # A topic that is named without its field is that with one column: it keeps all of them.
        self.whole = set(self.left) & set(recording.topics)

    def drop(self, path: str | None) -> None:
        """Count a path as used, and give its column up after the last time."""
        if path is None:
            return
        self.left[path] -= 1
        for name, topic in self.recording.topics.items():
            field = path[len(name) + 1 :]
            if path == f"{name}.{field}" and name not in self.whole and self.left[path] <= 0:
                topic.columns.pop(field, None)
