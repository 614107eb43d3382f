"""Which pieces of a log larger than the memory are fitted, which decide when to stop, and which are held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from collections.abc import Mapping as Dict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.executors import Executor
from auvnn.log_chunks.samples import (
    Piece,
    Pieces,
    Reading,
    concatenate_pieces,
    cut_at,
    evenly_spread_runs,
    inside,
    pieces_of_file,
    run_of,
)
from auvnn.logs.leakage import refuse_shared, rows_of
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import log_files
from auvnn.metrics.derivative import Derivative, chosen_derivative
from auvnn.progress import Progress
from auvnn.training.train import STOPPING

# Samples of the test that are looked for in the log that is fitted.
COMPARED = 20_000
# Share of a single run that is held out, as in `Log.split`.
HELD_OUT = 0.3

Say = Callable[[str], None]


@dataclass(frozen=True)
class DataSplit:
    """What each piece of a log is for.

    Attributes:
        fitted: what is fitted.
        stopping: what decides when to stop.
        test: what is held out.
        held_words: says which that is.
        stop_words: says which part decides when to stop.
    """

    fitted: Pieces
    stopping: Pieces
    test: Pieces
    held_words: str
    stop_words: str


def paths_of(log: str | Path | Sequence[str | Path]) -> list[Path]:
    """Return the files of a log: a file, a folder, a pattern, or a list of these."""
    return log_files([log] if isinstance(log, (str, Path)) else log)


def named(paths: Sequence[Path]) -> str:
    """Return the name of a log of these files, as `Log.read` names it."""
    return paths[0].stem if len(paths) == 1 else f"{paths[0].stem} and {len(paths) - 1} more"


def _plan_one(reading: Reading, path: Path) -> Pieces | InputError:
    try:
        return pieces_of_file(reading, path)
    except InputError as problem:
        return problem


def plan_files(pool: Executor, paths: Sequence[Path], reading: Reading, say: Say) -> Pieces:
    """Cut files into pieces.

    Args:
        pool: does it file by file.
        paths: of the files.
        reading: how they are read.
        say: called with what is being done, in words.

    Raises:
        InputError: none of them can be read, or they do not have the same columns.
    """
    good: list[Pieces] = []
    bad: list[InputError] = []
    answers = zip(paths, pool.run(_plan_one, reading, list(paths)), strict=True)
    for k, (path, found) in enumerate(answers, 1):
        say(Progress(f"looking through {path}", k, len(paths)))
        (bad if isinstance(found, InputError) else good).append(found)  # type: ignore[arg-type]
    # One file alone that cannot be read is the user's; one of many is left out and reported.
    if not good:
        raise bad[0]
    whole = concatenate_pieces(good)
    return replace(whole, notes=(*map(str, bad), *whole.notes))


def split_data(
    whole: Pieces,
    tested: Pieces | None,
    derivative: Dict[str, Any] | None,
    mapping: Mapping,
    name: str,
    test_name: str,
) -> tuple[DataSplit, Derivative]:
    """Say what is fitted, what decides when to stop and what is held out, and how accelerations are obtained.

    Args:
        whole: pieces of the log.
        tested: pieces of the test log, or None to hold out a part of the log.
        derivative: how accelerations are obtained.
        mapping: by which files are read.
        name: of the log.
        test_name: of the test log.
    """
    rest, test, held_words = whole, tested, f"{test_name} is held out"
    if test is None:
        rest, test, held_words = _split(whole, HELD_OUT, mapping, name)
    measured = all("nu_dot" in p.blocks for p in rest.pieces)
    how = chosen_derivative(name, measured, rest.dt(), derivative)
    fitted, stopping, stop_words = _split(rest, STOPPING, mapping, name)
    return DataSplit(fitted, stopping, test, held_words, stop_words), how


def _split(whole: Pieces, share: float, mapping: Mapping, name: str) -> tuple[Pieces, Pieces, str]:
    """Return what `Log.split` does."""
    runs = whole.runs
    if len(runs) > 1:
        held = whole.of_runs([runs[-1]])
        words = f"run {runs[-1]}, the last of '{name}', is held out ({held.samples} samples)"
        return whole.of_runs(runs[:-1]), held, words
    first, held = cut_at(whole, share, mapping)
    words = (
        f"the last {100 * share:.0f} % of the single run of '{name}', from t = {held.pieces[0].begin:.6g} s, "
        f"are held out ({held.samples} samples)"
    )
    return first, held, words


def _split_rows(shared: tuple[Mapping, NDArray[np.void]], piece: Piece) -> NDArray[np.bool_]:
    mapping, held = shared
    run = run_of(piece, mapping)
    return np.isin(held, rows_of([run.cut(inside(piece, run))]))


def refuse_leakage(pool: Executor, log: Pieces, test: Pieces, mapping: Mapping) -> None:
    """Refuse a test log that shares samples with what is fitted, as `logs.leakage.leakage` does, by some samples.

    Args:
        pool: does it piece by piece.
        log: pieces that are fitted.
        test: pieces that are held out.
        mapping: by which files are read.
    """
    held = rows_of(evenly_spread_runs(test, COMPARED, mapping))
    shared = np.zeros(len(held), dtype=bool)
    for found in pool.run(_split_rows, (mapping, held), list(log.pieces)):
        shared |= found
    refuse_shared(int(shared.sum()), len(held), "the test log", "the log")
