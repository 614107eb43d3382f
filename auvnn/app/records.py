"""What a session remembers: the models that there were, and the job that runs."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KINDS = ("compare", "diagnose", "add", "example")
ANSWERS = {"compare": "comparison", "diagnose": "diagnosis", "add": "improvement"}


@dataclass
class Step:
    """One model of the history.

    Attributes:
        source: name, file or folder from which it is loaded.
        words: what it is.
        effects: what was added to the one before it.
        answer: folder of the improvement that made it.
        error: held-out error, and that of the refitted model without the effects.
    """

    source: str
    words: str
    effects: tuple[str, ...] = ()
    answer: Path | None = None
    error: dict[str, float | None] = field(default_factory=dict)


@dataclass
class Job:
    """A job that runs or has run."""

    number: int
    kind: str
    words: str
    out: Path
    began: float
    state: str = "running"
    lines: list[str] = field(default_factory=list)
    error: str = ""
    effects: tuple[str, ...] = ()
    seconds: float = 0.0

    def told(self) -> dict[str, Any]:
        """Return the job for the page."""
        seconds = time.monotonic() - self.began if self.state == "running" else self.seconds
        return {
            "number": self.number, "kind": self.kind, "words": self.words, "state": self.state, "lines": self.lines[-8:],
            "count": len(self.lines), "error": self.error, "seconds": round(seconds, 1), "effects": list(self.effects),
        }  # fmt: skip


def words_of(kind: str, effects: list[str]) -> str:
    """Return what a job does, as a person reads it."""
    return {
        "compare": "Comparing model and log",
        "diagnose": "Looking for what is missing",
        "add": f"Fitting {', '.join(effects)}",
        "example": "Making the example",
    }[kind]
