"""From files to runs: read, map, order in time, correct, check; every step is counted."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import ConfigError, InputError
from auvnn.logs.readers import Table, choose
from auvnn.logs.readers.ros2_folder import ros2_files
from auvnn.logs.reading.collect import Collector, collect
from auvnn.logs.reading.head import read_table
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run
from auvnn.logs.seal import compare, file_hash, sealed


@dataclass
class Reading:
    """What a log is made of; the fields are those of `Log`."""

    runs: tuple[Run, ...]
    name: str
    paths: tuple[Path, ...]
    repairs: tuple[Repair, ...]
    sha256: str
    unknown: tuple[str, ...]
    unsealed: tuple[Path, ...]


def read(
    path: str | Path | Sequence[str | Path], mapping: Any = None, max_duration: float | None = None
) -> Reading:
    """Read one file or several as the runs of one log, of each file the first `max_duration` seconds.

    Args:
        path: of the file, or of several.
        mapping: a mapping, a path of one, or None for canonical columns and messages that are known.
        max_duration: s of each file from its beginning; all of it where None.

    Raises:
        InputError: a file cannot be read or its content must not be trusted.
        ConfigError: the mapping is wrong, or no file is named.
    """
    named = [Path(p) for p in ([path] if isinstance(path, (str, Path)) else path)]
    paths = [f for p in named for f in (ros2_files(p) if (p / "metadata.yaml").is_file() else [p])]
    if not paths:
        raise ConfigError("no log file is named; log= takes a path or a list of paths")
    doubled = {str(p) for p in paths if paths.count(p) > 1}
    if doubled:
        raise ConfigError(f"log files named twice: {', '.join(sorted(doubled))}")
    plan = Mapping.read(mapping)
    collector = Collector()
    hashes: list[str] = []
    unsealed: list[Path] = []
    for file in paths:
        before = _stamp(file)
        reader, notes = choose(file)
        collector.repairs.extend(notes)
        with np.errstate(all="ignore"):
            table, read = read_table(reader, file, plan, max_duration)
        if read is None:
            hashes.append(table.sha256 or file_hash(file))
        else:
            # Of a file that is far longer no more is read for this than for its first seconds.
            hashes.append(file_hash(file, read))
        if _stamp(file) != before:
            raise InputError(
                f"{file}: changed while it was read; wait until the recording or the copy is done"
            )
        collector.repairs.extend(_compared(file, hashes[-1], read is None, table, unsealed))
        collector.repairs.extend(table.repairs)
        first = len(collector.runs)
        # Damaged numbers may overflow on their way; what comes of it is masked and counted.
        with np.errstate(all="ignore"):
            collect(table, plan, file, collector, consume=True)
        _number_apart(collector, first, file, len(paths) > 1)
    same = {h for h in hashes if hashes.count(h) > 1}
    if same:
        twins = ", ".join(str(p) for p, h in zip(paths, hashes, strict=True) if h in same)
        raise InputError(f"these files hold the same bytes: {twins}; name each recording once")
    digest = hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()
    name = paths[0].stem if len(paths) == 1 else f"{paths[0].stem} and {len(paths) - 1} more"
    return Reading(
        tuple(collector.runs), name, tuple(paths), tuple(collector.repairs), digest, tuple(collector.unknown),
        tuple(unsealed),
    )  # fmt: skip


def _compared(file: Path, digest: str, whole: bool, table: Table, unsealed: list[Path]) -> list[Repair]:
    """Compare a file with its seal, and note a seal that could not be compared, or that nothing can be.

    Raises:
        InputError: the file is not what was sealed.
    """
    if not whole:
        words = "sealed, but only its beginning was read: the seal was not compared"
        return [Repair(words, str(file), 1, "info")] if sealed(file) is not None else []
    if not compare(file, digest) and not table.checked:
        unsealed.append(file)
    return []


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None
    return state.st_size, state.st_mtime_ns


def _number_apart(collector: Collector, first: int, file: Path, several: bool) -> None:
    """Give the runs of a further file their own numbers where they clash with earlier ones."""
    taken = {run.number for run in collector.runs[:first]}
    new = collector.runs[first:]
    if several and taken & {run.number for run in new}:
        start = max(taken)
        for i, run in enumerate(new):
            object.__setattr__(run, "number", start + 1 + i)
    if several:
        numbers = ", ".join(str(run.number) for run in new[:5]) + (", ..." if len(new) > 5 else "")
        collector.repairs.append(Repair(f"read as run {numbers}", str(file), len(new), "info"))
