"""What a page works on: the log, the model and its history, the answers, and what is said of them."""

from __future__ import annotations

import json
import shutil
import threading
from pathlib import Path
from typing import Any

from auvnn.app.jobs.messages import Summary
from auvnn.app.records import Job, Step
from auvnn.app.script import Told
from auvnn.app.source import Source
from auvnn.errors import ConfigError


class SessionState:
    """What one page works on, and what it needs to know of it at any moment.

    Args:
        work: folder for uploads and answers, taken away at the end.
        out: folder into which the user saves.
        model: name or path of the model to begin with, None for none.
    """

    def __init__(self, work: Path, out: Path, model: str | None = None) -> None:
        self.work, self.out = work, out
        self.lock = threading.RLock()
        self.version = 1
        self.source: Source | None = None
        self.history: list[Step] = [Step(model, "as given")] if model else []
        self.taken_back: list[Step] = []
        self.answers: dict[str, Path] = {}
        self.summaries: dict[str, Summary] = {}
        self.stale: set[str] = set()
        self.job: Job | None = None
        self.saved: list[str] = []
        self.reading, self._numbers = "", 0
        self.views: dict[str, Any] = {}
        self.looked = threading.Event()
        # Folders of answers whose report could not be drawn, and why; whether somebody is saving.
        self.undrawn: dict[str, str] = {}
        self.saving = False
        self.saved_without: list[str] = []

    def _forget(self) -> None:
        """Forget what was found with another log or another model; `self.lock` is held."""
        for folder in self.answers.values():
            shutil.rmtree(folder, ignore_errors=True)
        self.answers, self.summaries, self.views, self.stale = {}, {}, {}, set()
        self.history, self.taken_back = self.history[:1], []
        self.version += 1

    def refuse_busy(self) -> None:
        """Refuse what would change the ground under a job.

        Raises:
            ConfigError: a job is running.
        """
        if self.job is not None and self.job.state == "running":
            raise ConfigError(f"{self.job.words} is running: wait for it, or stop it first")
        if self.saving:
            raise ConfigError("what was found is being saved: wait for it")
        if self.reading:
            raise ConfigError(f"{self.reading} is being read: wait for it")

    def _new(self, kind: str) -> bool:
        """Whether an answer holds a model that has not been kept."""
        return kind in self.answers and self.answers[kind] not in [s.answer for s in self.history]

    def answer(self, kind: str) -> dict[str, Any]:
        """Return an answer with what goes beside it.

        Raises:
            ConfigError: there is none yet.
        """
        with self.lock:
            folder = self.answers.get(kind)
        if folder is None:
            raise ConfigError(f"there is no {kind} yet")
        answer, more = (
            json.loads((folder / f"{n}.json").read_text(encoding="utf-8")) for n in (kind, "more")
        )
        return {**answer, "more": more}

    def told(self) -> Told:
        """Return what was done, for the commands and the script."""
        with self.lock:
            if self.source is None or self.source.log is None or not self.history:
                raise ConfigError("there is no log and no model yet")
            steps = tuple(() if step.kind == "improve" else step.effects for step in self.history[1:])
            return Told(self.history[0].source, self.source.log.kind, steps, "diagnosis" in self.answers,
                        self.source.held is not None)  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Return what the page needs to know at any moment."""
        with self.lock:
            source = self.source
            return {
                "version": self.version,
                "reading": self.reading,
                "log": None if source is None else {
                    "name": source.log.name if source.log else source.files[0].name,
                    "error": source.error,
                    "ready": source.log is not None,
                    "judged": source.findings is not None,
                    "samples": source.log.samples if source.log else 0,
                    "sizes": source.sizes,
                    "held": source.words,
                },
                "history": [
                    {"words": s.words, "source": s.source if s.answer is None else "", "effects": list(s.effects),
                     "error": s.error} for s in self.history
                ],
                "taken_back": [s.words for s in self.taken_back],
                "can_keep": self._new("improvement"),
                "can_keep_improved": self._new("improve"),
                "answers": {k: {"summary": self.summaries[k], "stale": k in self.stale,
                                "report": (p / "report.html").is_file()} for k, p in self.answers.items()},
                "job": None if self.job is None else self.job.told(),
                "saved": self.saved,
                "saved_without": self.saved_without,
                "out": str(self.out),
            }  # fmt: skip
