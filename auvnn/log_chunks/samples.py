"""A log too large for memory as pieces: some ten thousand samples of one run each, read by whoever works on them.

Every sample is in exactly one piece, which is read with a margin of rows before and after it: for the history of the
actuators and for filters. What a run's typical values decide is decided by the rows of a piece, as in `metrics.parts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from auvnn.errors import InputError
from auvnn.log_chunks.scan import CHANGED, HOLD, ScanState, WindowCut
from auvnn.logs import Run
from auvnn.logs.log import blocks_of
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import Portion, read_portion
from auvnn.logs.seal import file_hash

# Samples of a piece at most, and s of history that it is read with, beside a filter's width.
SAMPLES, HISTORY = 25_000, 8.0


@dataclass(frozen=True)
class Piece:
    """Consecutive samples of one run.

    Attributes:
        path: the file.
        first: row of the file from which to read.
        count: rows to read.
        run: number of the run, unique in the log.
        begin: stamp of the first sample, s.
        end: stamp of the last one, s.
        samples: how many.
        opening: stamp of the run's first sample, s.
        dt: median step, s.
        blocks: what is measured, as `blocks_of` names it.
        low: no row before this time belongs to the log that the piece is of.
        high: nor one after this.
    """

    path: Path
    first: int
    count: int
    run: int
    begin: float
    end: float
    samples: int
    opening: float
    dt: float
    blocks: frozenset[str]
    low: float = -np.inf
    high: float = np.inf

    @property
    def name(self) -> str:
        """Return the piece's name among those of its log: no two have the same."""
        return f"{self.run}-{self.first}-{self.begin!r}-{self.end!r}"


@dataclass(frozen=True)
class Pieces:
    """All pieces of a log, in order.

    Attributes:
        pieces: at least one.
        rows: of all files.
        notes: what could not be used, in words.
        hashes: SHA-256 of each file's bytes.
    """

    pieces: tuple[Piece, ...]
    rows: int
    notes: tuple[str, ...] = ()
    hashes: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """Number of samples."""
        return sum(p.samples for p in self.pieces)

    @property
    def runs(self) -> list[int]:
        """Numbers of the runs, in order."""
        return list(dict.fromkeys(p.run for p in self.pieces))

    @property
    def duration(self) -> float:
        """Sum of the runs' durations, s."""
        first = {p.run: p.begin for p in reversed(self.pieces)}
        last = {p.run: p.end for p in self.pieces}
        return sum(last[r] - first[r] for r in first)

    def dt(self) -> float:
        """Return the median over the runs of their median steps, s."""
        steps = [np.median([p.dt for p in self.pieces if p.run == r]) for r in self.runs]
        return float(np.median(steps))

    def of_runs(self, wanted: Sequence[int]) -> Pieces:
        """Return the pieces of some runs."""
        return replace(self, pieces=tuple(p for p in self.pieces if p.run in set(wanted)))


@dataclass(frozen=True)
class Reading:
    """How pieces are cut out of files.

    Attributes:
        mapping: of the columns.
        half_width: samples on either side that a filter takes; None: nine in all, or 0.2 s on either side.
        samples: of a piece at most.
    """

    mapping: Mapping
    half_width: int | None = None
    samples: int = SAMPLES


def pieces_of_file(reading: Reading, path: Path) -> Pieces:
    """Return the pieces of one file.

    Raises:
        InputError: it cannot be read, rows of one run are apart, or none of its rows can be used.
    """
    return _PieceScan(path, reading).pieces()


def concatenate_pieces(found: Sequence[Pieces]) -> Pieces:
    """Return the pieces of several files; runs get their own numbers where they clash with earlier ones.

    Raises:
        InputError: the files do not have the same columns, or two hold the same bytes.
    """
    hashes = [h for each in found for h in each.hashes]
    if len(set(hashes)) < len(hashes):
        twins = [str(e.pieces[0].path) for e in found if e.pieces and hashes.count(e.hashes[0]) > 1]
        raise InputError(f"these files hold the same bytes: {', '.join(twins)}; name each recording once")
    pieces: list[Piece] = []
    taken: set[int] = set()
    for each in found:
        mine = each.runs
        start = max(taken, default=0)
        new = {r: start + 1 + i for i, r in enumerate(mine)} if taken & set(mine) else {r: r for r in mine}
        pieces += [replace(p, run=new[p.run]) for p in each.pieces]
        taken |= set(new.values())
    for piece in pieces:
        differ = sorted(piece.blocks ^ pieces[0].blocks)
        if differ:
            raise InputError(
                f"{pieces[0].path}, run {pieces[0].run}, and {piece.path}, run {piece.run}, differ in "
                f"{', '.join(differ)}: one log holds one vehicle; read them as separate logs"
            )
    notes = tuple(n for e in found for n in e.notes)
    return Pieces(tuple(pieces), sum(e.rows for e in found), notes, tuple(hashes))


class _PieceScan(ScanState):
    def __init__(self, path: Path, reading: Reading) -> None:
        super().__init__(path, WindowCut(0.0, 0.0, "", reading.mapping))
        self.reading, self.margin, self.after = reading, HISTORY, HOLD
        self.found: list[Piece] = []
        self.openings: dict[int, float] = {}

    def pieces(self) -> Pieces:
        rows = self.walk()
        return Pieces(tuple(self.found), rows, tuple(self.notes), (file_hash(self.path),))

    def windows(self, run: Run, anchor: float | None, ends: bool) -> tuple[list[tuple[int, int]], float]:
        half = self.reading.half_width or max(4, round(0.2 / run.dt))
        self.margin, self.after = max(HISTORY, (half + 2) * run.dt), max(HOLD, (half + 2) * run.dt)
        until = float(run.t[-1]) if ends else float(run.t[-1]) - self.after
        low = -np.inf if anchor is None else anchor
        rows = np.flatnonzero((run.t > low) & (run.t <= until))
        if not len(rows):
            return [], max(low, until) if anchor is not None else -np.inf
        # Equal pieces: none of them is a remnant too short for a filter.
        count = -(-len(rows) // self.reading.samples)
        return [(int(some[0]), int(some[-1])) for some in np.array_split(rows, count)], until

    def add(
        self, portion: Portion, at: int, run: Run, label: float, number: int, pieces: list[tuple[int, int]]
    ) -> None:
        opening = self.openings.setdefault(number, float(run.t[0]))
        mine = portion.label == label
        for a, b in pieces:
            begin, end = float(run.t[a]), float(run.t[b])
            with np.errstate(invalid="ignore"):
                rows = np.flatnonzero(
                    mine & (portion.t >= begin - self.margin) & (portion.t <= end + self.after)
                )
            self.known[number] += 1
            self.found.append(
                Piece(
                    self.path,
                    at + int(rows[0]),
                    int(rows[-1] - rows[0]) + 1,
                    number,
                    begin,
                    end,
                    b - a + 1,
                    opening,
                    run.dt,
                    blocks_of(run),
                )
            )


def run_of(piece: Piece, mapping: Mapping) -> Run:
    """Read a piece with its margins, as a run.

    Raises:
        InputError: the file is no longer what it was.
    """
    portion = read_portion(piece.path, mapping, piece.first, piece.count)
    for run in portion.runs:
        if piece.begin in run.t and piece.end in run.t:
            if run.t[0] < piece.low or run.t[-1] > piece.high:
                inside = np.flatnonzero((run.t >= piece.low) & (run.t <= piece.high))
                run = run.cut(slice(int(inside[0]), int(inside[-1]) + 1))
            return replace(run, number=piece.run)
    raise InputError(CHANGED.format(piece.path))


def inside(piece: Piece, run: Run) -> slice:
    """Return which samples of a run as it was read are those of the piece."""
    first, last = np.searchsorted(run.t, [piece.begin, piece.end])
    return slice(int(first), int(last) + 1)


def cut_at(pieces: Pieces, share: float, mapping: Mapping) -> tuple[Pieces, Pieces]:
    """Cut a single run in two in time, as `Log.split` does.

    Args:
        pieces: of one run.
        share: of its time that the second part takes.
        mapping: of the columns.

    Raises:
        InputError: a part would have fewer than three samples.
    """
    first, last = pieces.pieces[0], pieces.pieces[-1]
    at = first.begin + (1.0 - share) * (last.end - first.begin)
    before, after = [], []
    for piece in pieces.pieces:
        if piece.end < at:
            before.append(piece)
        elif piece.begin >= at:
            after.append(piece)
        else:
            run = run_of(piece, mapping)
            t = run.t[inside(piece, run)]
            k = int(np.searchsorted(t, at))
            before.append(replace(piece, end=float(t[k - 1]), samples=k))
            after.append(replace(piece, begin=float(t[k]), samples=len(t) - k))
    if min(sum(p.samples for p in part) for part in (before, after)) < 3:
        raise InputError(
            f"{first.path}: {pieces.samples} samples cannot be split into two parts of at least 3; "
            "name a test log with test="
        )
    end, begin = before[-1].end, after[0].begin
    return (
        replace(pieces, pieces=tuple(replace(p, high=min(p.high, end)) for p in before)),
        replace(pieces, pieces=tuple(replace(p, low=max(p.low, begin), opening=begin) for p in after)),
    )


def evenly_spread_runs(pieces: Pieces, most: int, mapping: Mapping, stretches: int = 8) -> list[Run]:
    """Return at most about `most` samples as runs numbered from 1: all of them, or stretches evenly spread.

    Args:
        pieces: of the files.
        most: about how many samples.
        mapping: by which the files are read.
        stretches: into how many parts the samples are spread.
    """
    chosen, length = pieces.pieces, most
    if pieces.samples > most:
        count = min(stretches, len(chosen))
        chosen = [chosen[int((i + 0.5) * len(chosen) / count)] for i in range(count)]
        length = most // count
    found = []
    for number, piece in enumerate(chosen, 1):
        run = run_of(piece, mapping)
        some = inside(piece, run)
        found.append(run.cut(slice(some.start, min(some.stop, some.start + length)), number))
    return found
