"""The first scan over a file: where its windows lie, by rows, without keeping samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs import Run
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import Portion, read_portion, rows_in, verify
from auvnn.metrics.windows import commands, starts

Array = NDArray[np.float64]


# Rows read at a time while planning, and windows of a part.
ROWS, WINDOWS = 100_000, 96


# s before a window that its part has at least, beside the actuators' history, and s at the end of a portion in which
# nothing is believed yet: new starts of the pose are recognised by the two seconds around them.
BEFORE, HOLD = 5.0, 2.5


@dataclass(frozen=True)
class WindowCut:
    """How windows are cut, for all parts alike.

    Attributes:
        horizon: length of a window, s.
        warmup: history for the actuators, s.
        kind: "thrusters" or "wrench".
        mapping: of the columns.
        partial: also keep a last window of at least half the length.
    """

    horizon: float
    warmup: float
    kind: str
    mapping: Mapping
    partial: bool = True


@dataclass(frozen=True)
class Part:
    """Windows of one run, in order.

    Attributes:
        path: the file.
        first: row of the file from which to read.
        count: rows to read.
        run: number of the run, unique in the plan.
        times: of each window's first and last sample, s, (n, 2).
        number: of the first window in its run.
        channels: names of the columns with samples in these rows.
    """

    path: Path
    first: int
    count: int
    run: int
    times: Array
    number: int
    channels: frozenset[str]

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.times)

    def some(self, chosen: slice) -> Part:
        """Return a part with some of the windows; the rows stay as they are."""
        return replace(self, times=self.times[chosen], number=self.number + (chosen.start or 0))


@dataclass(frozen=True)
class Plan:
    """All parts of a log, in order.

    Attributes:
        parts: at least one.
        samples: rows of all files.
        duration: s of all runs.
        runs: how many.
        notes: what could not be used, in words.
    """

    parts: tuple[Part, ...]
    samples: int
    duration: float
    runs: int
    notes: tuple[str, ...] = ()

    @property
    def windows(self) -> int:
        """Number of windows of all parts."""
        return sum(map(len, self.parts))

    def spread(self, most: int | None, together: int = 12) -> tuple[Part, ...]:
        """Return parts with at most about `most` windows: stretches of neighbours, evenly spread over the log.

        Args:
            most: windows; None or more than there are: all.
            together: windows of a stretch.
        """
        if most is None or self.windows <= most:
            return self.parts
        pieces = [
            part.some(slice(k, k + together))
            for part in self.parts
            for k in range(0, max(len(part) - together // 2, 1), together)
        ]
        count = max(int(most * len(pieces) / sum(map(len, pieces))), 1)
        if count >= len(pieces):
            return tuple(pieces)
        return tuple(pieces[int((i + 0.5) * len(pieces) / count)] for i in range(count))


class ScanState:
    """One file, walked through portion by portion; what is kept of each run is for `windows` and `add` to say.

    Args:
        path: the file.
        cut: how to read it, and how windows are cut.
    """

    def __init__(self, path: Path, cut: WindowCut) -> None:
        """Stand at the beginning of the file."""
        self.path, self.cut = path, cut
        self.margin = cut.warmup + BEFORE
        self.parts: list[Part] = []
        self.notes: list[str] = []
        self.duration, self.known = 0.0, dict[int, int]()
        # Run that goes on, its label in the file, and the time from which its next window begins.
        self.open: tuple[int, float, float] | None = None
        self.ended: set[float] = set()
        self.reached = -np.inf

    def go(self) -> Plan:
        """Return the plan."""
        total = self.walk()
        return Plan(tuple(self.parts), total, self.duration, len(self.known), tuple(self.notes))

    def walk(self) -> int:
        """Go through the file and return its rows.

        Raises:
            InputError: it cannot be read, rows of one run are apart, or none of its rows can be used.
        """
        verify(self.path)
        total = rows_in(self.path)
        at, size, failed = 0, ROWS, None
        while at < total:
            last = at + size >= total
            try:
                portion = read_portion(self.path, self.cut.mapping, at, size)
            except InputError as problem:
                # Rows of which nothing can be used are no reason to refuse days of others.
                failed, self.open = problem, None
                self.notes.append(f"{self.path}: rows {at} to {min(at + size, total)} left out: {problem}")
                at += size
                continue
            self._portion(portion, at, last)
            then = total if last else self._next(portion, at)
            # A portion must be longer than what is taken over into the next.
            size = ROWS if then - at > ROWS // 4 or last else 2 * size
            at = max(then, at) if then > at else at
        if failed is not None and not self.known:
            raise failed
        return total

    def _portion(self, portion: Portion, at: int, last: bool) -> None:
        self._refuse_scattered(portion)
        for k, run in enumerate(portion.runs):
            label = float(run.number)
            goes_on = self.open is not None and k == 0 and self.open[1] == label
            number = self.open[0] if goes_on and self.open else self._numbered(run.number)
            anchor = self.open[2] if goes_on and self.open else None
            ends = last or k < len(portion.runs) - 1
            before = self.reached if goes_on else run.t[0]
            self.duration += float(run.t[-1]) - float(before)
            self.reached = float(run.t[-1])
            pieces, begin = self.windows(run, anchor, ends)
            self.add(portion, at, run, label, number, pieces)
            self.open = None if ends else (number, label, begin)

    def windows(self, run: Run, anchor: float | None, ends: bool) -> tuple[list[tuple[int, int]], float]:
        """Return first and last sample of each window of a run, and the time from which to go on.

        Args:
            run: as far as the portion holds it.
            anchor: the time from which to go on with a run that has begun in the portion before.
            ends: whether the run ends in this portion.
        """
        cut, (_, known) = self.cut, commands(run, self.cut.kind)
        until = run.t[-1] if ends else run.t[-1] - HOLD
        found: list[tuple[int, int]] = []
        for part in run.unbroken(known):
            if anchor is not None and run.t[part.stop - 1] < anchor:
                continue
            begin = anchor if anchor is not None and run.t[part.start] <= anchor else None
            over = ends or run.t[part.stop - 1] <= until
            new, then = starts(
                run, part, cut.horizon, cut.horizon, cut.partial, begin, np.inf if over else float(until)
            )
            found += new
            if not over:
                return found, then
        return found, float(until)

    def add(
        self, portion: Portion, at: int, run: Run, label: float, number: int, pieces: list[tuple[int, int]]
    ) -> None:
        """Keep the windows found in a run.

        Args:
            portion: of the file, from row `at` on.
            at: that row.
            run: the run.
            label: its number in the file.
            number: its number in the plan.
            pieces: what `windows` has found.
        """
        mine = portion.label == label
        channels = frozenset(run.channels)
        for k in range(0, len(pieces), WINDOWS):
            some = pieces[k : k + WINDOWS]
            times = np.array([(run.t[a], run.t[b]) for a, b in some])
            low, high = times[0, 0] - self.margin, times[-1, 1] + HOLD
            with np.errstate(invalid="ignore"):
                rows = np.flatnonzero(mine & (portion.t >= low) & (portion.t <= high))
            begin = self.known[number]
            self.known[number] += len(some)
            self.parts.append(
                Part(
                    self.path, at + int(rows[0]), int(rows[-1] - rows[0]) + 1, number, times, begin, channels
                )
            )

    def _next(self, portion: Portion, at: int) -> int:
        """Return the row at which the next portion begins."""
        if self.open is None:
            return at + len(portion.t)
        _, label, begin = self.open
        with np.errstate(invalid="ignore"):
            rows = np.flatnonzero((portion.label == label) & (portion.t >= begin - self.margin))
        return at + (int(rows[0]) if len(rows) else len(portion.t))

    def _numbered(self, wanted: int) -> int:
        number = wanted if wanted not in self.known else max(self.known) + 1
        self.known[number] = 0
        return number

    def _refuse_scattered(self, portion: Portion) -> None:
        label = portion.label
        blocks = [label[0], *(b for a, b in pairwise(label) if b != a)] if len(label) else []
        begun = set[float]()
        for k, value in enumerate(blocks):
            again = value in begun or value in self.ended
            if again and not (k == 0 and self.open is not None and self.open[1] == value):
                raise InputError(
                    f"{self.path}: the rows of run {value:g} are not together: sort the file by run and time"
                )
            begun.add(value)
        # A portion may take up rows of the run that went on; all others before the last are over.
        self.ended |= set(blocks[:-1])


CHANGED = "{}: is no longer the file that was looked through: start again"


def _covering(portion: Portion, part: Part) -> Run:
    """Return the run that has all the part's windows in it."""
    low, high = part.times[0, 0], part.times[-1, 1]
    for run in portion.runs:
        if low in run.t and high in run.t:
            return run
    raise InputError(CHANGED.format(part.path))
