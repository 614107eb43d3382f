"""Some rows of a long recording, made into runs by the same steps as a whole log."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.clock_origin import counted_from
from auvnn.logs.readers import READERS, choose
from auvnn.logs.readers.ros2_folder import ros2_files
from auvnn.logs.reading.collect import FIRST_ROWS, Collector, FileClock, collect
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.run import Run
from auvnn.logs.seal import compare, file_hash, sealed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Portion:
    """Rows of a file and the runs in them.

    Attributes:
        t: stamps in the order of the file, on the clock of its runs, s, (N,); NaN where one is missing.
        label: run number of each row, (N,); ones where the file has none.
        runs: in the order of the file; corrected as on reading a whole log, with what these rows say alone.
    """

    t: Array
    label: Array
    runs: tuple[Run, ...]


def rows_in(path: Path) -> int:
    """Return the number of rows of a log file.

    Raises:
        InputError: it cannot be read.
    """
    return choose(path)[0].rows(path)


def verify(path: Path) -> None:
    """Compare a file that is to be read in parts with its own hash, and with its seal.

    Raises:
        InputError: it differs from what was written, or sealed.
    """
    choose(path)[0].verify(path)
    if sealed(path) is not None:
        compare(path, file_hash(path))


def read_portion(path: Path, mapping: Mapping, first: int, count: int) -> Portion:
    """Read `count` rows of a file from row `first` on.

    Args:
        path: of the file.
        mapping: by which it is read.
        first: number of the first row, from 0.
        count: of rows.

    Raises:
        InputError: they cannot be read, or hold no run; runs that have names in the place of numbers.
    """
    reader, _ = choose(path)
    collector = Collector()
    with np.errstate(all="ignore"):
        table = reader.mapped_rows(path, mapping, first, count)
        if table.rows == 0:
            raise InputError(f"{path}: has no row {first}")
        name = mapping.run if mapping.run not in (None, "file") else "run"
        if mapping.run != "file" and name in table.text:
            raise InputError(
                f"{path}: column '{name}' names the runs: a log that is read in parts needs numbers there, or one "
                "run per file (mapping run: file)"
            )
        clock = _clock(path, mapping) if first else None
        collect(table, mapping, path, collector, clock)
    clock = clock or FileClock.of(table, mapping)
    t = counted_from(clock.seconds(table, mapping), clock.origin)
    numbered = mapping.run != "file" and name in table.columns
    label = table.columns[str(name)].astype(np.float64) if numbered else np.ones(table.rows)
    return Portion(t, label, tuple(collector.runs))


def log_files(places: Iterable[str | Path]) -> list[Path]:
    """Return the log files that paths, folders and patterns name, those of a folder or pattern in order of their names.

    Args:
        places: a path that is there is taken as it is, a folder stands for the log files in it, and what holds
            `*`, `?` or `[` for all that match.

    Raises:
        InputError: a folder or a pattern with no log file.
    """
    known = tuple(s for name in READERS.names() for s in READERS.get(name).suffixes)
    found: list[Path] = []
    for place in map(Path, places):
        if place.is_dir() and (place / "metadata.yaml").is_file():
            found += ros2_files(place)
        elif place.is_dir():
            inside = sorted(p for p in place.iterdir() if p.is_file() and p.suffix.lower() in known)
            if not inside:
                raise InputError(
                    f"{place}: is a folder without a log file in it; they end in {', '.join(known)}"
                )
            found += inside
        elif not place.exists() and any(sign in str(place) for sign in "*?["):
            # A folder whose own name holds such signs is there, and is no pattern.
            root, parts = Path(place.anchor), list(place.parts[1 if place.is_absolute() else 0 :])
            while parts and (root / parts[0]).exists():
                root = root / parts.pop(0)
            inside = sorted(p for p in root.glob(str(Path(*parts))) if p.is_file())
            if not inside:
                raise InputError(f"{place}: no file matches this pattern")
            found += inside
        else:
            found.append(place)
    return list(dict.fromkeys(found))


# Rows beyond which a log is better taken in parts, and bytes of a text file that are about one row.
LARGE, ROW_BYTES = 200_000, 300


def is_large(paths: Sequence[Path]) -> bool:
    """Say whether log files hold more than `LARGE` rows together, by their tables of contents or their sizes.

    Raises:
        InputError: a file cannot be read.
    """
    rows = 0
    for path in paths:
        reader, _ = choose(path)
        if not reader.in_parts:
            continue  # topics are merged as a whole
        rows += reader.rows(path) if reader.name == "parquet" else path.stat().st_size // ROW_BYTES
        if rows > LARGE:
            return True
    return False


# Rows by which a file's kind is recognised.
_FIRST = 5000


def kind_of(paths: Sequence[Path], mapping: Any = None) -> str:
    """Return what drives the vehicle of a log: "thrusters" or "wrench", by the first rows of its first file.

    Raises:
        InputError: they cannot be read.
    """
    return kinds_of(paths, mapping)[0]


def kinds_of(paths: Sequence[Path], mapping: Any = None) -> tuple[str, ...]:
    """Return what commands a log has, by the first rows of its first file, the kind that is taken by default first.

    Raises:
        InputError: they cannot be read.
    """
    run = read_portion(paths[0], Mapping.read(mapping), 0, _FIRST).runs[0]
    there = {"thrusters": run.thrusters is not None, "wrench": run.wrench is not None}
    return (run.kind, *(k for k, known in there.items() if known and k != run.kind))


def _clock(path: Path, mapping: Mapping) -> FileClock:
    """Return from when a file's stamps count; the last one is kept for as long as the file does not change."""
    state = path.stat()
    key = (str(path), state.st_size, state.st_mtime_ns, repr(mapping))
    if key not in _CLOCKS:
        found = FileClock.of(choose(path)[0].mapped_rows(path, mapping, 0, FIRST_ROWS), mapping)
        _CLOCKS.clear()
        _CLOCKS[key] = found
    return _CLOCKS[key]


_CLOCKS: dict[tuple[str, int, int, str], FileClock] = {}
# s since 1970 beyond which a stamp is a date.
_UNIX = 1e8


def start_of(path: Path, mapping: Mapping) -> float | None:
    """Return when a log begins, s since 1970, or None where its stamps count from another beginning.

    Raises:
        InputError: it cannot be read.
    """
    reader, _ = choose(path)
    source = mapping.columns["t"].source if "t" in mapping.columns else "t"
    stamp = None if source is None else reader.first_stamp(path, source)
    if stamp is not None:
        return stamp
    table = reader.mapped_rows(path, mapping, 0, 1)
    if "t" not in table.columns or table.rows == 0:
        return None
    first = float(mapping.seconds(table.columns["t"], "t" in table.seconds)[0])
    return first if first > _UNIX else None
