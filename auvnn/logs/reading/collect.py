"""From one table to runs: told apart, in order of time, corrected and checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs import clock_origin
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
from auvnn.logs.readers import Table
from auvnn.logs.reading import required
from auvnn.logs.reading.mapping_file import frames, in_world
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.recordings import several_rates
from auvnn.logs.reading.repairs import attitude, clock, delays, masks, plausible
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.reading.stacking import stacked
from auvnn.logs.run import MIN_SAMPLES, Run

Array = NDArray[np.float64]

# Rows by which it is decided whether a file's stamps are dates.
FIRST_ROWS = 5000


@dataclass
class Collector:
    """What has been read so far."""

    runs: list[Run] = field(default_factory=list)
    repairs: list[Repair] = field(default_factory=list)
    unknown: dict[str, None] = field(default_factory=dict)


@dataclass(frozen=True)
class FileClock:
    """From when the stamps of a file count, whichever of its rows are read.

    Attributes:
        first: the file's first stamp as it stands there, from which integers are counted.
        origin: s, taken off stamps that are dates; zero for others.
    """

    first: Any
    origin: float

    @classmethod
    def of(cls, table: Table, plan: Mapping) -> FileClock:
        """Return it by the first rows of a file."""
        raw = table.columns["t"][:FIRST_ROWS]
        first = raw[0] if len(raw) else 0.0
        return cls(first, clock_origin.origin_of(plan.seconds(raw, "t" in table.seconds, first)))

    def seconds(self, table: Table, plan: Mapping) -> Array:
        """Return the stamps of a table, s, (N,), dates as dates."""
        return plan.seconds(table.columns["t"], "t" in table.seconds, self.first)


def collect(
    table: Table,
    plan: Mapping,
    file: Path,
    collector: Collector,
    clock_from: FileClock | None = None,
    consume: bool = False,
) -> None:
    """Turn a table into runs: told apart, in order of time, corrected and checked.

    Args:
        table: columns under canonical names.
        plan: the mapping.
        file: from which they are, for messages.
        collector: takes the runs and the repairs.
        clock_from: from when the file's stamps count, where the table is a part of it.
        consume: whether the table may be emptied, to spare memory.
    """
    where = str(file)
    plan = table.rest or plan
    required.check_required(table, where)
    collector.repairs.extend(required.notes(table, where))
    label_column = plan.run if plan.run not in (None, "file") else "run"
    groups = [(1, np.arange(table.rows))]
    names = list(table.columns)
    if plan.run != "file" and label_column in table.names:
        groups = _groups(table, str(label_column), where, collector)
    outside = [n for n in names if not is_canonical(n) and n != plan.run]
    collector.unknown.update(dict.fromkeys(outside))
    begin = FileClock.of(table, plan) if clock_from is None else clock_from
    t = begin.seconds(table, plan)
    if begin.origin and clock_from is None:
        collector.repairs.append(clock_origin.note(begin.origin, where, table.rows))
    highest = max(number for number, _ in groups)
    for number, rows in groups:
        here = where if len(groups) == 1 else f"{where}, run {number}"
        mine = t if len(groups) == 1 else t[rows]
        rows = _without_repeats(table, mine, rows, here, collector.repairs)
        stretches, notes = clock.order_in_time(mine if len(rows) == len(mine) else t[rows], here)
        collector.repairs.extend(notes)
        for i in range(len(stretches)):
            if i:
                highest += 1
            taken = rows[stretches[i]]
            # A log that needs no sorting is not copied: it may be large.
            whole = len(taken) == table.rows and bool((np.diff(taken) == 1).all())
            pick = slice(None) if whole else taken
            columns = {n: c[pick].astype(np.float64, copy=False) for n, c in table.columns.items()}
            columns["t"] = clock_origin.counted_from(t[pick], begin.origin)
            del taken
            if whole and consume:
                # This was all: the table, and row numbers as large as a column, are given up before the run is built.
                table.columns.clear()
                stretches.clear()
                groups.clear()
                del t, mine, rows
            columns, notes = delays.undo_delays(columns, plan, here)
            collector.repairs.extend(notes)
            columns, notes = several_rates.settle(columns, plan, here)
            collector.repairs.extend(notes)
            run = _run(number if i == 0 else highest, columns, outside, plan, here, collector.repairs)
            collector.runs.append(run)


def _without_repeats(
    table: Table, t: Array, rows: NDArray[np.intp], where: str, repairs: list[Repair]
) -> NDArray[np.intp]:
    """Return the rows but those that are, stamp and values, an earlier row again: blocks that were written twice."""
    if not (np.diff(t[np.isfinite(t)]) < 0.0).any():
        return rows  # nothing is written twice where time only runs on, and most logs end here
    _, first, inverse = np.unique(t, return_index=True, return_inverse=True, equal_nan=False)
    earlier = first[inverse]
    again = np.flatnonzero(earlier < np.arange(len(t)))
    for column in table.columns.values():
        one, other = column[rows[earlier[again]]], column[rows[again]]
        same = (
            one == other if column.dtype.kind != "f" else (one == other) | (np.isnan(one) & np.isnan(other))
        )
        again = again[same]
    if len(again) < MIN_SAMPLES:
        return rows
    words = "rows that are earlier ones again, stamps and values, left out (a block written twice?)"
    repairs.append(
        Repair(words, where, len(again), "warning", "export the log again if rows are missing elsewhere")
    )
    return np.delete(rows, again)


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
        missing = np.broadcast_to(np.nan, len(columns["t"]))
        return stacked([columns.pop(n, missing) for n in names])

    velocity = block(VELOCITY)
    if velocity is None:
        velocity = np.full((len(columns["t"]), 6), np.nan)
    raw = block(QUATERNION) if all(n in columns for n in QUATERNION) else None
    if raw is not None:
        quaternion, notes = attitude.from_quaternions(raw, where)
    else:
        angles = block(EULER)
        if angles is None:
            angles = np.full((len(columns["t"]), 3), np.nan)
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
        ballast=columns.get("ballast"),
        density=columns.get("density"),
        moving_mass=columns.get("moving_mass"),
        reset=columns.get(RESET),
        extra={n: columns[n] for n in outside},
    )
    run, notes = in_world.settle(run, plan, where)
    repairs.extend(notes)
    for correct in (plausible.check_plausible, masks.apply):
        run, notes = correct(run, where)
        repairs.extend(notes)
    return run
