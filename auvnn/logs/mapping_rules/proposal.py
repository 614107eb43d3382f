"""A mapping proposed for a recording: of each thing that a log needs, the best topic that is known to give it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auvnn.logs.channels import EULER, POSITION, QUATERNION, VELOCITY, is_canonical
from auvnn.logs.mapping_rules.rule import BLOCKS, Rule
from auvnn.logs.reading.mapping_file.suggest import likely
from auvnn.logs.recording import Recording, Topic

_NEEDS = {
    "attitude": (QUATERNION, EULER),
    "velocity": (VELOCITY[:3],),
    "rates": (VELOCITY[3:],),
    "commands": (("thruster_1",), ("tau_X",), ("fin_1",), ("ballast",)),
}


@dataclass
class Proposal:
    """A mapping as plain data, and what to say about it.

    Args:
        mapping: what a mapping file holds; its columns may be {}.
        notes: what was assumed.
        lacks: what a log needs and the recording's known messages do not give.
        refused: topics that are known to lie about their frame, and why.
        guessed: canonical columns that were proposed by the names of fields alone.
    """

    mapping: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    lacks: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    guessed: list[str] = field(default_factory=list)


def propose(
    recording: Recording, rules: Sequence[Rule], lies: Callable[[Topic], str], guesses: bool
) -> Proposal:
    """Return the mapping that rules suggest for a recording.

    Args:
        recording: topics with their columns.
        rules: which topics and fields are known, in order of preference.
        lies: says about a topic why it must not be believed; empty where it may.
        guesses: go by names that only sound right where no rule fits.
    """
    columns: dict[str, Any] = {}
    topics: dict[str, Any] = {}
    notes: list[str] = []
    refused = {t.name: words for t in recording.topics.values() if (words := lies(t))}
    for block in BLOCKS:
        best = _best(block, recording, rules, set(refused))
        if best is None:
            continue
        rule, topic, found = best
        fresh = {n: s for n, s in found.items() if n not in columns}
        if block == "depth" and "z" in columns:
            continue
        columns |= fresh
        frame = rule.framed(topic)
        if frame:
            topics[topic.name] = topics.get(topic.name, {}) | frame
        if rule.note and rule.note not in notes:
            notes.append(rule.note.format(topic=topic.name))
    guessed = _guess(recording, columns) if guesses else []
    names = set(columns)
    lacks = [b for b, groups in _NEEDS.items() if not any(set(g) <= names for g in groups)]
    mapping: dict[str, Any] = {"columns": columns}
    runs = _best("runs", recording, rules, set(refused))
    if runs is not None:
        mapping["run"] = {"from": runs[2]["run"]}
    if topics:
        mapping["topics"] = topics
    if any(t.kind == "moos" for t in recording.topics.values()):
        mapping["commands"] = {"longest": 3600.0}
    return Proposal(mapping, notes, lacks, refused, guessed)


def _best(
    block: str, recording: Recording, rules: Sequence[Rule], refused: set[str]
) -> tuple[Rule, Topic, dict[str, Any]] | None:
    found = []
    for place, rule in enumerate(rules):
        if rule.block != block:
            continue
        for topic in recording.topics.values():
            if topic.name in refused or topic.messages < 3:
                continue
            columns = rule.of(recording, topic)
            if columns:
                rate = topic.rate if np.isfinite(topic.rate) else 0.0
                found.append((rule.rank, -round(rate, 1), place, topic.name, rule, topic, columns))
    if not found:
        return None
    best = min(found, key=lambda f: f[:4])
    return best[4], best[5], best[6]


def _guess(recording: Recording, columns: dict[str, Any]) -> list[str]:
    """Add fields of unknown messages whose names sound right; return the canonical columns."""
    paths = [f"{t.name}.{c}" if t.name else c for t in recording.topics.values() for c in t.columns]
    if len(paths) > 5_000:
        return []
    added = []
    wanted = [n for n in (*VELOCITY, *POSITION) if n not in columns]
    if not {*QUATERNION} & set(columns) and not {*EULER} & set(columns):
        wanted += [*EULER]
    for name in wanted:
        found = next(
            (p for p in paths if p.rsplit(".", 1)[-1] == name and not is_canonical(p)), None
        ) or likely(name, paths)
        if found:
            columns[name] = found
            added.append(name)
    return added
