"""A log as a notebook shows it and as a container: its runs by place, its columns by name, its card, its figure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

import numpy as np

from auvnn.answers import DRAWERS
from auvnn.cards import Card, Shown
from auvnn.errors import ConfigError
from auvnn.logs.run import Run


class ShownLog(Shown):
    """What a log inherits of this."""

    name: str
    runs: tuple[Run, ...]
    repairs: tuple[Any, ...]

    @property
    def samples(self) -> int:
        """Number of samples of all runs."""
        ...

    @property
    def duration(self) -> float:
        """Sum of the runs' durations, s."""
        ...

    @property
    def kind(self) -> str:
        """What actuates the vehicle."""
        ...

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        ...

    def __contains__(self, item: object) -> bool:
        """Say whether the log has a column of this name, or this run."""
        return item == "run" or item in self.runs[0] if isinstance(item, str) else item in self.runs

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        """Go through the runs."""
        return iter(self.runs)

    def __getitem__(self, key: int | slice | str) -> Any:
        """Return a run by its place, a log of some of them by a slice, or a column of all runs by its name.

        Columns are those of the file, `run`, and `phi`, `theta`, `psi`; rows of one run follow those of the one before.
        """
        if isinstance(key, str):
            if key == "run":
                return np.repeat([run.number for run in self.runs], [run.samples for run in self.runs])
            return np.concatenate([run[key] for run in self.runs])
        if isinstance(key, slice):
            if not self.runs[key]:
                raise ConfigError(f"log '{self.name}' has {len(self)} runs; the slice takes none of them")
            return replace(cast(Any, self), runs=self.runs[key])
        try:
            return self.runs[key]
        except IndexError:
            last = len(self) - 1
            raise IndexError(
                f"log '{self.name}' has no run at place {key}: it has {len(self)}, at 0{f' to {last}' if last else ''}"
            ) from None

    def card(self) -> Card:
        """Return the log's runs, rate and channels."""
        runs = "1 run" if len(self) == 1 else f"{len(self)} runs"
        rate = np.median([1.0 / run.dt for run in self.runs])
        line = f"{runs}, {self.samples} samples over {self.duration:.4g} s at {rate:.3g} Hz, driven by {self.kind}"
        rows = [[str(r.number), str(r.samples), f"{r.duration:.4g}", f"{1.0 / r.dt:.3g}"] for r in self.runs]
        columns = self.columns
        few = ", ".join(columns[:30]) + (f" and {len(columns) - 30} more" if len(columns) > 30 else "")
        said = [f"Columns: {few}.", *(str(r) for r in self.repairs[:3])]
        head = ("run", "samples", "duration (s)", "rate (Hz)")
        return Card(
            f"Log {self.name}", line, said, head, rows, 'log[0] a run, log["u"] a column, .quality(), .plot()'
        )

    def plot(self) -> Any:
        """Return a matplotlib Figure of the log's first run: velocities, attitude and commands over time."""
        return next(iter(DRAWERS.get("log").figures(self).values()))
