"""From files to runs: read, map, order in time, mend, check; every step is counted."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ConfigError, InputError
from auvnn.logs.channels import (
    ACCELERATION,
    EULER,
    POSITION,
    QUATERNION,
    RESET,
    VELOCITY,
    WRENCH,
    is_canonical,
    numbered,
)
from auvnn.logs.readers import Table, choose
from auvnn.logs.reading import attitude, clock, delays, frames, masks, plausible, required
from auvnn.logs.reading.head import read_table
from auvnn.logs.reading.mapping import Mapping
from auvnn.logs.reading.repair import Repair
from auvnn.logs.run import Run

Array = NDArray[np.float64]


@dataclass
class Reading:
    """What a log is made of; the fields are those of `Log`."""

    runs: tuple[Run, ...]
    name: str
    paths: tuple[Path, ...]
    repairs: tuple[Repair, ...]
    sha256: str
    unknown: tuple[str, ...]


@dataclass
class Collector:
    """What has been read so far."""

    runs: list[Run] = field(default_factory=list)
    repairs: list[Repair] = field(default_factory=list)
    unknown: dict[str, None] = field(default_factory=dict)


def read(
    path: str | Path | Sequence[str | Path], mapping: Any = None, max_duration: float | None = None
) -> Reading:
    """Read one file or several as the runs of one log, of each file the first `max_duration` seconds.

    Raises:
        InputError: a file cannot be read or its content must not be trusted.
        ConfigError: the mapping is wrong, or no file is named.
    """
    paths = [Path(p) for p in ([path] if isinstance(path, (str, Path)) else path)]
    if not paths:
        raise ConfigError("no log file is named; log= takes a path or a list of paths")
    doubled = {str(p) for p in paths if paths.count(p) > 1}
    if doubled:
        raise ConfigError(f"log files named twice: {', '.join(sorted(doubled))}")
    plan = Mapping.read(mapping)
    collector = Collector()
    hashes = []
    for file in paths:
        before = _stamp(file)
        reader, notes = choose(file)
        collector.repairs.extend(notes)
        with np.errstate(all="ignore"):
            table = read_table(reader, file, plan, max_duration)
        hashes.append(file_hash(file))
        if _stamp(file) != before:
            raise InputError(
                f"{file}: changed while it was read; wait until the recording or the copy is done"
            )
        collector.repairs.extend(table.repairs)
        first = len(collector.runs)
        # Damaged numbers may overflow on their way; what comes of it is masked and counted.
        with np.errstate(all="ignore"):
            collect(table, plan, file, collector)
        _number_apart(collector, first, file, len(paths) > 1)
    same = {h for h in hashes if hashes.count(h) > 1}
    if same:
        twins = ", ".join(str(p) for p, h in zip(paths, hashes, strict=True) if h in same)
        raise InputError(f"these files hold the same bytes: {twins}; name each recording once")
    digest = hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()
    name = paths[0].stem if len(paths) == 1 else f"{paths[0].stem} and {len(paths) - 1} more"
    return Reading(
        tuple(collector.runs), name, tuple(paths), tuple(collector.repairs), digest, tuple(collector.unknown)
    )


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None
    return state.st_size, state.st_mtime_ns


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file's bytes.

    Raises:
        InputError: it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as problem:
        raise InputError(f"{path}: disappeared while it was read: {problem}") from None


def _number_apart(collector: Collector, first: int, file: Path, several: bool) -> None:
    """Give the runs of a further file numbers of their own where they clash with earlier ones."""
    taken = {run.number for run in collector.runs[:first]}
    new = collector.runs[first:]
    if several and taken & {run.number for run in new}:
        start = max(taken)
        for i, run in enumerate(new):
            object.__setattr__(run, "number", start + 1 + i)
    if several:
        numbers = ", ".join(str(run.number) for run in new[:5]) + (", ..." if len(new) > 5 else "")
        collector.repairs.append(Repair(f"read as run {numbers}", str(file), len(new), "info"))


def collect(table: Table, plan: Mapping, file: Path, collector: Collector) -> None:
    """Turn a table into runs: told apart, in order of time, mended and checked."""
    where = str(file)
    required.check_required(table, where)
    collector.repairs.extend(required.notes(table, where))
    label_column = plan.run if plan.run not in (None, "file") else "run"
    groups = [(1, np.arange(table.rows))]
    if plan.run != "file" and label_column in table.names:
        groups = _groups(table, str(label_column), where, collector)
    outside = [n for n in table.columns if not is_canonical(n) and n != plan.run]
    collector.unknown.update(dict.fromkeys(outside))
    t = plan.seconds(table.columns["t"], "t" in table.seconds)
    highest = max(number for number, _ in groups)
    for number, rows in groups:
        here = where if len(groups) == 1 else f"{where}, run {number}"
        stretches, notes = clock.order_in_time(t[rows], here)
        collector.repairs.extend(notes)
        for i, stretch in enumerate(stretches):
            if i:
                highest += 1
            taken = rows[stretch]
            # A log that needs no sorting is not copied: it may be large.
            whole = len(taken) == table.rows and bool((np.diff(taken) == 1).all())
            pick = slice(None) if whole else taken
            columns = {n: c[pick].astype(np.float64, copy=False) for n, c in table.columns.items()}
            columns["t"] = t[pick]
            columns, notes = delays.undo_delays(columns, plan, here)
            collector.repairs.extend(notes)
            run = _run(number if i == 0 else highest, columns, outside, plan, here, collector.repairs)
            collector.runs.append(run)


def _groups(table: Table, name: str, where: str, collector: Collector) -> list[tuple[int, NDArray[np.intp]]]:
    """Return number and rows of each run, in the order of their first appearance."""
    if name in table.text:
        text = table.text[name]
        if text.codes is None:
            raise InputError(f"{where}: column '{name}' cannot number the runs: {text.bad}")
        values = text.codes.astype(np.float64)
        values[values < 0] = np.nan
        words = f"runs named in '{name}' numbered from 1: {', '.join(map(str, text.labels[:10]))}"
        collector.repairs.append(Repair(words, where, len(text.labels), "info"))
        values += 1
    else:
        values = table.columns[name].astype(np.float64)
    nameless = int(np.isnan(values).sum())
    if nameless:
        raise InputError(
            f"{where}: {nameless} rows have no run number in column '{name}'; fill it or leave it out"
        )
    found, first, inverse = np.unique(values, return_index=True, return_inverse=True)
    by_run = np.split(np.argsort(inverse, kind="stable"), np.cumsum(np.bincount(inverse))[:-1])
    whole = bool((found == np.round(found)).all() and np.abs(found).max() < 2**31)
    if not whole:
        words = f"run numbers in '{name}' are not whole: numbered from 1 in the order of the file"
        collector.repairs.append(Repair(words, where, len(found), "info"))
    if len(found) > max(1, table.rows // 3):
        raise InputError(f"{where}: column '{name}' has {len(found)} different values in {table.rows} rows: "
                         "that is no run number")  # fmt: skip
    ordered = np.argsort(first)
    return [(int(found[k]) if whole else i + 1, by_run[k]) for i, k in enumerate(ordered)]


def _run(
    number: int,
    columns: dict[str, Array],
    outside: list[str],
    plan: Mapping,
    where: str,
    repairs: list[Repair],
) -> Run:
    def block(names: Sequence[str]) -> Array | None:
        if not any(n in columns for n in names):
            return None
        missing = np.full(len(columns["t"]), np.nan)
        return np.stack([columns.get(n, missing) for n in names], axis=1)

    velocity = block(VELOCITY)
    assert velocity is not None  # required.check has seen these columns
    raw = block(QUATERNION) if all(n in columns for n in QUATERNION) else None
    if raw is not None:
        quaternion, notes = attitude.from_quaternions(raw, where)
    else:
        angles = block(EULER)
        assert angles is not None
        quaternion, notes = attitude.from_angles(angles, columns["t"], velocity[:, 5], where)
    repairs.extend(notes)
    acceleration, wrench, position = block(ACCELERATION), block(WRENCH), block(POSITION)
    run = Run(
        number=number,
        t=columns["t"],
        quaternion=frames.quaternion_to_ned_frd(quaternion, plan.body, plan.world),
        nu=frames.six_to_frd(velocity, plan.body),
        nu_dot=None if acceleration is None else frames.six_to_frd(acceleration, plan.body),
        position=None if position is None else frames.position_to_ned(position, plan.world),
        wrench=None if wrench is None else frames.six_to_frd(wrench, plan.body),
        thrusters=block(numbered("thruster", columns)),
        fins=block(numbered("fin", columns)),
        altitude=columns.get("altitude"),
        voltage=columns.get("voltage"),
        reset=columns.get(RESET),
        extra={n: columns[n] for n in outside},
    )
    for mend in (plausible.check_plausible, masks.apply):
        run, notes = mend(run, where)
        repairs.extend(notes)
    return run
