"""What a session remembers: the models that there were, and the job that runs."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KINDS = ("compare", "diagnose", "add", "improve", "example")
ANSWERS = {"compare": "comparison", "diagnose": "diagnosis", "add": "improvement", "improve": "improve"}
# Answers that hold a model to go on with.
MODELS = ("improvement", "improve")


@dataclass
class Step:
    """One model of the history.

    Attributes:
        source: name, file or folder from which it is loaded.
        words: what it is.
        effects: what was added to the one before it.
        answer: folder of the improvement that made it.
        error: held-out error, and that of the refitted model without the effects.
        kind: of the answer: "improvement" for effects that were fitted, "improve" for the whole loop.
    """

    source: str
    words: str
    effects: tuple[str, ...] = ()
    answer: Path | None = None
    error: dict[str, float | None] = field(default_factory=dict)
    kind: str = "improvement"


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
        "improve": "Walking the whole loop",
        "example": "Making the example",
    }[kind]


def step_of(kind: str, folder: Path, answer: dict[str, Any]) -> Step:
    """Return the model that an answer holds as a step of the history.

    Args:
        kind: "improvement" or "improve".
        folder: of the answer.
        answer: its JSON.
    """
    falls = [w for w in answer["waterfall"] if w["step"] != "noise floor"]
    floor = next((w["error"] for w in answer["waterfall"] if w["step"] == "noise floor"), None)
    error = {"before": falls[0]["error"], "after": falls[-1]["error"], "floor": floor}
    if kind == "improve":
        names = tuple(str(s["step"]) for s in answer["steps"])
        words = f"improved by {', '.join(names)}" if names else "improved by nothing: it stays as given"
    else:
        names = tuple(answer["effects"])
        words = f"with {', '.join(names)}"
    return Step(str(folder / "model"), words, names, folder, error, kind)
