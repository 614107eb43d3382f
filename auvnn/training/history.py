"""How a fit went, iteration by iteration, and the progress bar that shows it to a person."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

from auvnn.damping.base import AXES


@dataclass(frozen=True)
class Record:
    """One iteration: root-mean-square error divided by the spread of the target, by degree of freedom.

    Args:
        iteration: counted from 1.
        train: (6,) relative error on what is fitted.
        held_out: (6,) relative error on the runs that are held out, or None.
    """

    iteration: int
    train: tuple[float, ...]
    held_out: tuple[float, ...] | None = None

    @property
    def worst(self) -> float:
        """The largest of the six training errors."""
        return max(self.train)


Callback = Callable[[Record], "bool | None"]


@dataclass
class History:
    """The records of a fit, in order."""

    records: list[Record] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return `{axes, iteration, train, held_out}`; `held_out` is empty where nothing was held out."""
        return {
            "axes": list(AXES),
            "iteration": [record.iteration for record in self.records],
            "train": [list(record.train) for record in self.records],
            "held_out": [list(r.held_out) for r in self.records if r.held_out is not None],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> History:
        """Rebuild what `to_dict` returned."""
        held = data["held_out"] or [None] * len(data["train"])
        rows = zip(data["iteration"], data["train"], held, strict=True)
        return cls([Record(i, tuple(t), None if h is None else tuple(h)) for i, t, h in rows])


class Progress:
    """A callback that draws a progress bar on a terminal, and does nothing anywhere else.

    Use as a context: `with Progress(300) as progress: fit_damping(..., callback=progress)`.

    Args:
        total: iterations at most.
        label: words in front of the bar.
    """

    def __init__(self, total: int | None = None, label: str = "training") -> None:
        """Keep what the bar will say; nothing is drawn yet."""
        self._total, self._label = total, label
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        """Start the bar if standard error is a terminal."""
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress as Bar

            self._bar = Bar(console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self._label, total=self._total)
            self._bar.start()
        return self

    def __call__(self, record: Record) -> None:
        """Move the bar to this iteration."""
        if self._bar is not None:
            words = f"{self._label}  worst relative error {record.worst:.2e}"
            self._bar.update(self._task, completed=record.iteration, description=words)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
