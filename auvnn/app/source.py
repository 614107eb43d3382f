"""The log of a session: where it comes from, how it is read, and what of it is held out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auvnn.app.jobs.messages import LogOrder
from auvnn.app.logview import ColumnView, RawColumn, columns, findings, guesses, overview, raw_columns, traces
from auvnn.app.traces import POINTS
from auvnn.errors import AuvnnError, one_line
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping


@dataclass
class Source:
    """A log as it was read, or why it could not be.

    Attributes:
        files: the files.
        mapping: how their columns are named; {} for canonical ones.
        max_duration: of each file, s.
        test: files that are held out, where they are named apart.
        raw: columns of the first file under their own names.
        log: all that was read; None where it could not be.
        fit: what is fitted on.
        held: what is held out, None where the log is too short for that.
        words: which is which.
        error: why there is no log.
        findings: of the quality report, None until they are there.
        sizes: how many of them, by level.
        columns: the canonical columns, as the screen shows them.
        overview: runs and groups of channels.
        guesses: which columns of a file probably hold canonical ones.
    """

    files: list[Path]
    mapping: dict[str, Any] = field(default_factory=dict)
    max_duration: float | None = None
    test: list[Path] = field(default_factory=list)
    raw: list[RawColumn] = field(default_factory=list)
    log: Log | None = None
    fit: Log | None = None
    held: Log | None = None
    words: str = ""
    error: str = ""
    findings: list[dict[str, Any]] | None = None
    sizes: dict[str, Any] = field(default_factory=dict)
    columns: list[ColumnView] = field(default_factory=list)
    overview: dict[str, Any] | None = None
    guesses: dict[str, str] = field(default_factory=dict)

    def read(self) -> Source:
        """Read the files; what goes wrong is kept in words."""
        self.raw = raw_columns(self.files[0])
        self.guesses = guesses(self.raw)
        try:
            Mapping.read(self.mapping or None)
            self.log = Log.read(self.files if len(self.files) > 1 else self.files[0], self.mapping or None,
                                max_duration=self.max_duration)  # fmt: skip
            if self.test:
                self.fit, self.held = self.log, Log.read(self.test, self.mapping or None)
                self.words = f"{self.held.name} is held out ({self.held.samples} samples)"
            else:
                self.fit, self.held, self.words = split(self.log)
            # Worked out once: the first look at a long log should not wait for it.
            self.columns = columns(self.log, self.mapping)
            self.overview = overview(self.log)
            for group in ("velocity", "rates", "commands"):
                traces(self.log, None, group, None, None, POINTS)
        except AuvnnError as error:
            self.error = one_line(error, 2000)
        return self

    def judge(self) -> None:
        """Make the quality report, which takes a while for a long log."""
        if self.log is None:
            return
        quality = self.log.quality()
        self.sizes = {
            k: v for k, v in quality.metrics.items() if k in ("errors", "warnings", "repairs", "gaps")
        }
        self.findings = findings(quality)

    def order(self) -> LogOrder:
        """Return what the child process needs to read the same."""
        return {
            "files": [str(p) for p in self.files],
            "mapping": self.mapping,
            "max_duration": self.max_duration,
            "test": [str(p) for p in self.test],
            "words": self.words,
        }

    def described(self) -> dict[str, Any]:
        """Return the columns and the mapping, for the screen of the log."""
        return {
            "files": [str(p) for p in self.files],
            "mapping": self.mapping,
            "raw": self.raw,
            "guesses": self.guesses,
            "columns": self.columns,
            "unknown": [] if self.log is None else list(self.log.unknown),
            "overview": self.overview,
            "fit_runs": [] if self.fit is None else _runs(self.fit),
            "held": None if self.held is None else {"name": self.held.name, "runs": _runs(self.held)},
            "held_words": self.words,
        }


def _runs(log: Log) -> list[dict[str, Any]]:
    return [
        {"number": r.number, "samples": r.samples, "begin": float(r.t[0]), "end": float(r.t[-1])}
        for r in log.runs
    ]


def split(log: Log) -> tuple[Log, Log | None, str]:
    """Return what to fit on and what is held out, or all and nothing where the log is too short to be divided."""
    try:
        return log.split()
    except AuvnnError as problem:
        return log, None, str(problem)
