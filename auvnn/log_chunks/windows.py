"""A log too large for memory, planned as parts: windows of free running by the rows of the files that hold them.

The plan goes once through each file, some hundred thousand rows at a time, and finds the windows that `cut_windows`
would find in the whole log: a window that a portion of rows does not complete is looked for again in the next, from
the same begin. A part then needs its own rows only, and is read by whoever computes it. Memory is needed for one
portion, and for three numbers per window.

What a run's typical values decide (its median step, what counts as a spike, which depth is a sentinel) is decided by
the rows of a portion instead of by the whole run; with a clean and even recording that makes no difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.log_chunks.scan import CHANGED, Part, Plan, ScanState, WindowCut, _covering
from auvnn.logs import Run
from auvnn.logs.reading.portions import read_portion
from auvnn.metrics.windows import Piece, Windows, commands, gathered
from auvnn.progress import each

Array = NDArray[np.float64]


def plan_files(
    paths: Sequence[Path], cut: WindowCut, say: Callable[[str], None] = lambda words: None
) -> Plan:
    """Plan the windows of many files.

    Args:
        paths: of the files.
        cut: how windows are cut.
        say: called with what is being done, in words.

    Raises:
        InputError: a file cannot be read, or none has a window.
    """
    found = []
    for path in each(paths, say, lambda path: f"looking through {path}"):
        found.append(plan_file(cut, path))
    return concatenate_windows(found)


def concatenate_windows(found: Sequence[Plan]) -> Plan:
    """Return the plan of several files; runs get their own numbers where they clash with earlier ones.

    Raises:
        InputError: there is no window in any of them.
    """
    parts: list[Part] = []
    taken: set[int] = set()
    for plan in found:
        mine = list(dict.fromkeys(p.run for p in plan.parts))
        start = max(taken, default=0)
        new = {r: start + 1 + i for i, r in enumerate(mine)} if taken & set(mine) else {r: r for r in mine}
        parts += [replace(p, run=new[p.run]) for p in plan.parts]
        taken |= set(new.values())
    notes = tuple(n for plan in found for n in plan.notes)
    if not parts:
        none = "no stretch of the log is long enough for a window without a gap"
        raise InputError(
            notes[0] if notes else f"{none}; one that lacks a velocity is read whole: stream=false"
        )
    return Plan(
        tuple(parts),
        sum(p.samples for p in found),
        sum(p.duration for p in found),
        sum(p.runs for p in found),
        notes,
    )


def plan_file(cut: WindowCut, path: Path) -> Plan:
    """Plan the windows of one file.

    Raises:
        InputError: it cannot be read, rows of one run are apart, or none of its rows can be used.
    """
    return ScanState(path, cut).go()


def windows_of(part: Part, cut: WindowCut) -> Windows:
    """Read a part's rows and return its windows.

    Raises:
        InputError: the file is no longer what the plan saw.
    """
    portion = read_portion(part.path, cut.mapping, part.first, part.count)
    pieces: list[Piece] = []
    run = _covering(portion, part)
    command, known = commands(run, cut.kind)
    unbroken = run.unbroken(known)
    for a, b in np.searchsorted(run.t, part.times):
        begin = next((s.start for s in unbroken if s.start <= a and b < s.stop), None)
        if begin is not None:
            pieces.append((replace(run, number=part.run), command, int(a), int(b), begin))
    if len(pieces) != len(part):
        raise InputError(CHANGED.format(part.path))
    made = gathered(pieces, cut.warmup)
    return replace(made, first=part.number + np.arange(len(part)))


def runs_of(parts: Sequence[Part], cut: WindowCut) -> list[Run]:
    """Return the stretches that some parts cover, each as a separate run, numbered from 1.

    Raises:
        InputError: a file is no longer what the plan saw.
    """
    found = []
    for number, part in enumerate(parts, 1):
        portion = read_portion(part.path, cut.mapping, part.first, part.count)
        run = _covering(portion, part)
        first, last = np.searchsorted(run.t, [part.times[0, 0], part.times[-1, 1]])
        found.append(run.cut(slice(int(first), int(last) + 1), number))
    return found
