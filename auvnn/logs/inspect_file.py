"""Looking into a file before it is read as a log: what it holds, how fast, and which mapping would make a log of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvnn.config import dump_yaml
from auvnn.errors import InputError
from auvnn.logs.channels import is_canonical
from auvnn.logs.mapping_rules import Proposal, propose
from auvnn.logs.readers import choose
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic

_SHOWN_FIELDS = 400
_HEAD_BYTES = 8_000_000
_LACKING = {
    "attitude": "an attitude (qw qx qy qz, or phi theta psi)",
    "velocity": "velocities u v w",
    "rates": "rates p q r",
    "commands": "commands (thruster_1 ..., tau_X ... tau_N or fin_1 ...)",
}


@dataclass(frozen=True)
class Look:
    """What a file holds and what could be made of it.

    Args:
        path: the file.
        format: name of its reader.
        recording: its topics, or the beginnings of them; a table is one topic without a name.
        proposal: the mapping that is proposed, fields that only sound right among it.
        certain: whether the file is read without a mapping.
        repairs: what was noted while looking.
    """

    path: Path
    format: str
    recording: Recording
    proposal: Proposal
    certain: bool
    repairs: tuple[Repair, ...] = ()

    @property
    def used(self) -> dict[str, list[tuple[str, str]]]:
        """By topic the (canonical column, path of its source) that the proposal takes from it."""
        found: dict[str, list[tuple[str, str]]] = {}
        for name, spec in self.proposal.mapping["columns"].items():
            source = spec if isinstance(spec, str) else spec.get("from", "")
            topic = max(
                (t for t in self.recording.topics if source.startswith(f"{t}.") or source == t),
                key=len,
                default="",
            )
            if not topic:
                topic = source.split(".")[0].replace("[primary]", "[0]")
            found.setdefault(topic, []).append((name, source))
        return found

    @property
    def lacks(self) -> list[str]:
        """What a log needs that nothing in the proposal gives, in words."""
        return [_LACKING[b] for b in self.proposal.lacks]

    def to_dict(self) -> dict[str, Any]:
        """Return topics, fields, rates and the proposed mapping as plain data."""
        used = self.used
        topics = [
            {"topic": t.name, "type": t.kind, "messages": t.messages, "rate_hz": _finite(t.rate),
             "fields": list(t.columns)[:_SHOWN_FIELDS], "gives": [n for n, _ in used.get(t.name, [])],
             "refused": self.proposal.refused.get(t.name)}
            for t in self.recording.topics.values()
        ]  # fmt: skip
        return {
            "path": str(self.path), "format": self.format, "topics": topics, "mapping": self.proposal.mapping,
            "needs_mapping": not self.certain, "guessed": self.proposal.guessed, "lacks": self.lacks,
            "notes": self.proposal.notes,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return what there is to say, a line each: topics that give something first, then the others by name."""
        used = self.used
        out = []
        for topic in sorted(self.recording.topics.values(), key=lambda t: (t.name not in used, t.name)):
            if topic.name in used:
                gives = ", ".join(f"{n} <- {s[len(topic.name) + 1 :] if s.startswith(topic.name + '.') else s}"
                                  for n, s in used[topic.name])  # fmt: skip
                out.append(f"topic     {_told(topic)}: {gives}")
        for name, why in self.proposal.refused.items():
            out.append(f"refused   {name}: {why}")
        others = [
            t
            for t in self.recording.topics.values()
            if t.name not in used and t.name not in self.proposal.refused and t.name
        ]
        for topic in others[:40]:
            fields = [c for c in topic.columns if "covar" not in c]
            some = ", ".join(fields[:8]) + (f", ... ({len(fields)} fields)" if len(fields) > 8 else "")
            out.append(f"unused    {_told(topic)}: {some or 'no numbers'}")
        if len(others) > 40:
            out.append(f"unused    and {len(others) - 40} more topics; all are in quality.json")
        for words in self.proposal.notes:
            out.append(f"assumed   {words}")
        if self.proposal.guessed:
            out.append(f"guessed   by their names alone, to be checked: {', '.join(self.proposal.guessed)}")
        for words in self.lacks:
            out.append(f"lacking   {words}")
        return out

    def mapping_text(self) -> str:
        """Return the proposed mapping as the text of a file, with what should be known of it in comments."""
        head = [
            f"# Proposed for {self.path.name} ({self.format}). Check order and sign of the thrusters, units and frames."
        ]
        head += [f"# Assumed: {words}" for words in self.proposal.notes]
        head += (
            [f"# Guessed by name alone: {', '.join(self.proposal.guessed)}"] if self.proposal.guessed else []
        )
        head += [f"# Lacking: {words}" for words in self.lacks]
        head += [f"# Refused: {name}: {why}" for name, why in self.proposal.refused.items()]
        others = [t for t in self.recording.topics.values() if t.name and t.name not in self.used]
        head += [f"# There is also: {_told(t)}" for t in others[:60]]
        head = ["".join(c if c.isprintable() else "?" for c in line) for line in head]
        return "\n".join(head) + "\n" + dump_yaml(self.proposal.mapping, "the proposed mapping")


def look(path: str | Path) -> Look:
    """Return what a file holds, how fast, and the mapping that is proposed for it.

    Raises:
        InputError: it cannot be read, or has no known format.
    """
    path = Path(path)
    reader, notes = choose(path)
    if isinstance(reader, RecordingReader):
        recording = reader.survey(path)
    else:
        size = max(path.stat().st_size, 1)
        table = reader.read_head(path, min(1.0, _HEAD_BYTES / size))
        t = table.columns.get("t")
        times = t.astype("f8") if t is not None else None
        rows = Topic(
            "",
            "array",
            times if times is not None else _index(table.rows),
            dict(table.columns),
            count=table.rows,
        )
        recording = Recording({"": rows}, list(table.repairs))
    certain = propose(recording)
    whole = not certain.lacks or bool(certain.mapping["columns"])
    proposal = propose(recording, guesses=bool(certain.lacks))
    named = [n for n, s in proposal.mapping["columns"].items() if s != n or not is_canonical(n)]
    return Look(path, reader.name, recording, proposal, whole and not (set(named) & set(proposal.guessed)),
                tuple([*notes, *recording.repairs]))  # fmt: skip


def write_mapping(found: Look, path: Path, overwrite: bool = False) -> Path:
    """Write the proposed mapping.

    Args:
        found: what was found in a file.
        path: of the mapping file.
        overwrite: replace a file that is there.

    Raises:
        InputError: there is such a file already, or nothing to propose.
    """
    from auvnn.answers import write_text

    if path.exists() and not overwrite:
        raise InputError(f"mapping_out={path}: is there already; choose another name, or say overwrite=true")
    if not found.proposal.mapping["columns"]:
        fields = ", ".join(found.recording.topics) or "nothing"
        raise InputError(
            f"{found.path}: no field of it is known or sounds like what a log needs; it has {fields[:300]}"
        )
    return write_text(path, found.mapping_text())


def _told(topic: Topic) -> str:
    rate = f"{topic.rate:.3g} Hz" if math.isfinite(topic.rate) else "once"
    kind = f" {topic.kind}" if "/" in topic.kind else ""
    return f"{topic.name or 'table'}{kind} ({topic.messages} at {rate})"


def _index(rows: int) -> Any:
    import numpy as np

    return np.arange(rows, dtype=np.float64)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
