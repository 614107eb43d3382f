"""What was noted while files were read, each thing once: the same note of several files is one line.

Notes that change nothing about a result (level "info") are `check`'s to tell; the other commands count them. What was
corrected or is doubted is reported by every command that computes with it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

# Places that are named before the rest is counted.
NAMED = 2


class Note(Protocol):
    """A repair of a log, or anything else with a place, words and a level."""

    @property
    def what(self) -> str:
        """What was found or done."""
        ...

    @property
    def where(self) -> str:
        """File, run or column."""
        ...

    @property
    def level(self) -> str:
        """One of error, warning, repair, info."""
        ...


def together(places: Sequence[str]) -> str:
    """Return places as words: all of a few, the first of many and how many more."""
    places = list(dict.fromkeys(places))
    if len(places) <= NAMED:
        return " and ".join(places)
    return f"{', '.join(places[:NAMED])} and {len(places) - NAMED} more"


N = TypeVar("N", bound=Note)
# A finding carries the number of samples concerned at the end of its words.
_COUNT = re.compile(r" \((\d+)\)$")


def once(notes: Iterable[N]) -> list[tuple[N, str]]:
    """Return the first note of each level and words, and all that say the same as one sentence, in order."""
    found: dict[tuple[str, str], list[N]] = {}
    for note in notes:
        found.setdefault((note.level, _COUNT.sub("", note.what)), []).append(note)
    out = []
    for (_, words), same in found.items():
        counts = [str(getattr(n, "count", "")) or "".join(_COUNT.findall(n.what)) for n in same]
        shown = (
            f" ({', '.join(counts[: NAMED + 1])}{', ...' if len(counts) > NAMED + 1 else ''})"
            if counts[0]
            else ""
        )
        out.append((same[0], f"{together([n.where for n in same])}: {words}{shown}"))
    return out


def noted(notes: Sequence[Note]) -> list[tuple[str, str]]:
    """Return (level, words) of notes for a command that computes: corrected and doubted things, and how many more."""
    found = once(notes)
    lines = [(first.level, words) for first, words in found if first.level != "info"]
    quiet = len(found) - len(lines)
    if quiet:
        many = "1 note" if quiet == 1 else f"{quiet} notes"
        lines.append(("info", f"{many} on how it was read: see auvnn check"))
    return lines
