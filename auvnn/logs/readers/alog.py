"""Logs of MOOS (`.alog`): lines of time, variable, source and value; each variable is a topic.

`%% LOGSTART` gives the beginning, s since 1970; times count from there, or from 1970 where they lie near it.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from auvnn.errors import InputError
from auvnn.logs.readers.memory import refuse_more_than_memory
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_START = re.compile(rb"^%%+[ \t]*LOGSTART[ \t]+([-+.0-9eE]+)", re.MULTILINE)
_LONGEST_LINE = 100_000
_MOST_TOPICS = 5_000
_ABSOLUTE = 1e8  # s beyond which a time is a date
_TYPE_MARK = re.compile(rb"^[DS][: ]")


class AlogReader(RecordingReader):
    """Variables of MOOS, those with numbers."""

    name = "alog"
    suffixes = (".alog",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts with the comments of a MOOS log."""
        return head.lstrip().startswith(b"%%") and (b"LOGSTART" in head or b"LOG FILE" in head)

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the variables that are wanted."""
        where = str(path)
        stamps: dict[str, list[float]] = {}
        values: dict[str, list[float]] = {}
        texts: dict[str, int] = {}
        bad = lines = 0
        begin: float | None = None
        try:
            refuse_more_than_memory(path.stat().st_size, where)
            with path.open("rb") as stream:
                head = stream.read(20_000)
                stream.seek(0)
                for line in stream:
                    if line.startswith(b"%") or not line.strip():
                        continue
                    lines += 1
                    parts = line.split(None, 3) if len(line) <= _LONGEST_LINE else []
                    if len(parts) < 4:
                        bad += 1
                        continue
                    try:
                        t = float(parts[0])
                    except ValueError:
                        bad += 1
                        continue
                    if begin is None:
                        begin = t
                    if until is not None and t - begin > until + 1.0:
                        continue
                    name = parts[1].decode("utf-8", "replace")
                    if name not in values and len(values) >= _MOST_TOPICS:
                        continue
                    number = _number(parts[3].strip())
                    if number is None:
                        texts[name] = texts.get(name, 0) + 1
                    else:
                        stamps.setdefault(name, []).append(t)
                        values.setdefault(name, []).append(number)
        except OSError as problem:
            raise InputError(f"{where}: cannot be read: {problem.strerror}") from None
        if not values:
            raise InputError(f"{where}: holds no line of time, variable, source and number: no MOOS log")
        notes = []
        if bad:
            notes.append(
                Repair("lines that are no `time variable source value` left out", where, bad, "warning")
            )
        found = _START.search(head)
        start = _number(found[1]) if found else None
        topics = {}
        for name, numbers in values.items():
            if (texts.get(name, 0) < len(numbers)) and (wanted is None or wanted(name, "moos")):
                t = np.array(stamps[name])
                # Some programs write dates in the place of times since the beginning.
                t = np.where(t > _ABSOLUTE, t - (start if start is not None else float(begin or 0.0)), t)
                topics[name] = Topic(name, "moos", t, {"value": np.array(numbers)})
        return Recording(topics, notes)


def _number(text: bytes) -> float | None:
    try:
        value = float(text)
    except ValueError:
        if not _TYPE_MARK.match(text):
            return None
        try:
            value = float(text[2:])
        except ValueError:
            return None
    return value if math.isfinite(value) else None
