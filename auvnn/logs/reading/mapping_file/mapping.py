"""The mapping file: a user's own columns turned into the canonical ones, by data alone.

A value passes through these steps, in this order: the curve `(value - neutral) / span` cut to [-1, 1],
`value * scale + offset`, the unit (`angles`, `rates`, `time`), and last the frame (`FLU` to `FRD`, `ENU`
to `NED`). A `scale: -1` therefore turns a sign in the frame in which the file was recorded.

`valid: {from: bottom_lock, is: 1}` takes a value only where another column of the file says that it is good (`is` one
value or a list, numbers or words; `above`, `below`); elsewhere it counts as missing. An estimator of several cores is
followed by `from: [u_0, u_1], by: primary`, or, where each core has separate rows, by `core: {column: C, primary: PI}`.

A `delay` says by how many seconds a column lags behind the time it is stamped with (`auvnn check` measures it for
the velocities): once the runs are told apart, each of them takes its values from that much later in the record.

What recordings of many topics need beside this (`unit`, `mix`, `over`, `difference`, `in`, `pressure`, and the
sections `topics`, `rows`, `commands`, `heading`, `definitions`) is read and explained in `mapping_more`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.config import read_yaml
from auvnn.errors import InputError
from auvnn.logs.channels import EULER, QUATERNION, RESET, is_canonical
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file import mapping_more
from auvnn.logs.reading.mapping_file.columns import Column, _column, _core, _known, _one_of, _run, _section
from auvnn.logs.reading.mapping_file.mapping_more import Commands, Heading, TopicRule
from auvnn.logs.reading.repairs import cores
from auvnn.logs.reading.repairs.repair import Repair

_KEYS = ("columns", "frame", "angles", "rates", "quaternion", "time", "run", "core", *mapping_more.SECTIONS)
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATES = ("p", "q", "r", "dp", "dq", "dr")
_NO_SIGNAL = 65535.0


@dataclass(frozen=True)
class Mapping:
    """A mapping file's content, checked.

    Args:
        columns: canonical name to how it is made; names not listed are taken from the file as they are.
        body: frame in which velocities, accelerations and the wrench are given, "FRD" or "FLU".
        world: frame in which attitude and position are given, "NED" or "ENU".
        angles: "rad" or "deg", of phi, theta, psi and the fins.
        rates: "rad" or "deg", of p, q, r and their derivatives.
        quaternion: "wxyz", or "xyzw" where the columns qw qx qy qz, in this order, hold x, y, z, w.
        time_unit: unit of `t`: "s", "ms", "us" or "ns".
        run: column that numbers or names the runs, None for `run`, "file" for one run per file.
        core: columns that hold a row's core and the core in use, where each core has separate rows.
        where: the mapping's file, for messages.
        topics: how each topic of a recording is stamped and framed, by its name.
        rows: topic whose times the rows have; None to choose.
        commands: what holds between two commands.
        heading: what is added to the measured heading.
        definitions: folder of `.msg` files, for bags without definitions.
    """

    columns: dict[str, Column] = field(default_factory=dict)
    body: str = "FRD"
    world: str = "NED"
    angles: str = "rad"
    rates: str = "rad"
    quaternion: str = "wxyz"
    time_unit: str = "s"
    run: str | None = None
    where: str = "mapping"
    core: tuple[str, str] | None = None
    topics: dict[str, TopicRule] = field(default_factory=dict)
    rows: str | None = None
    commands: Commands = field(default_factory=Commands)
    heading: Heading | None = None
    definitions: str | None = None

    @classmethod
    def read(cls, source: str | Path | MappingType[str, Any] | Mapping | None) -> Mapping:
        """Read a mapping from a YAML file or a dict; None gives the mapping that changes nothing.

        Raises:
            ConfigError: a key or a value is unknown.
            InputError: the file cannot be read.
        """
        if source is None:
            return cls()
        if isinstance(source, Mapping):
            return source
        if isinstance(source, MappingType):
            return _build(dict(source), "mapping")
        return _build(read_yaml(Path(source)), str(source))

    def apply(self, table: Table, where: str) -> Table:
        """Return the table under canonical names; columns that were not asked for keep theirs.

        Raises:
            InputError: a column named in the mapping is not in the file, or is text.
        """
        if self.core is not None:
            table = cores.rows_of_primary(table, *self.core, where, self.where)
        result = Table({}, table.rows, {}, set(), list(table.repairs))
        used: set[str] = set()
        for name, column in self.columns.items():
            if column.source is None and not column.more.mix:
                result.columns[name] = np.full(table.rows, column.value)
                continue
            if column.by is not None:
                each = [self._source(table, name, c, where) for c in column.cores]
                chosen = self._source(table, name, column.by, where)
                values = cores.chosen(each, chosen, name, column.by, where)
                used |= {*column.cores, column.by}
                cores.note_switches(result, chosen, column.by, where)
            elif column.more.mix:
                each = [self._source(table, name, c, where) for c, _ in column.more.mix]
                values = self.mixed(each, column, name, where, result)
                used |= {c for c, _ in column.more.mix}
            else:
                assert column.source is not None
                values = self._source(table, name, column.source, where)
                used.add(column.source)
                if column.more.over is not None:
                    values = column.more.speed(values, self._source(table, name, column.more.over, where))
                    used.add(column.more.over)
            if column.source in table.seconds:
                result.seconds.add(name)
            if not column.more.mix:
                values = self._convert(values, column, name, where, result)
            if column.valid is not None:
                values, note = column.valid.mask(values, table, name, where, self.where)
                result.repairs += note
                used.add(column.valid.source)
            result.columns[name] = values
        if self.run not in (None, "file"):
            self._source(table, "run", str(self.run), where, numbers=False)
        if self.core is not None:
            used |= set(self.core)
            result.columns.setdefault(RESET, table.columns[self.core[1]])
        for name in table.names:
            if name in self.columns and name not in used:
                words = f"column '{name}' of the file replaced by the mapping's"
                result.repairs.append(Repair(words, where, 1, "info"))
            elif name not in used:
                kind = "columns" if name in table.columns else "text"
                getattr(result, kind)[name] = getattr(table, kind)[name]
                if name in table.seconds:
                    result.seconds.add(name)
        self._units(result)
        return result

    def _source(self, table: Table, name: str, source: str, where: str, numbers: bool = True) -> NDArray[Any]:
        if source in table.columns:
            return table.columns[source]
        if source in table.text:
            if not numbers:
                return np.empty(0)
            bad = table.text[source].bad
            raise InputError(f"{where}: column '{source}' for '{name}' is no column of numbers: {bad}")
        raise InputError(f"{where}: {self.where} takes '{name}' from a column that is not there: "
                         f"{unknown_name('column', source, table.names)}")  # fmt: skip

    def mixed(
        self, each: list[NDArray[Any]], column: Column, name: str, where: str, result: Table
    ) -> NDArray[np.float64]:
        """Return the weighed sum of inputs that have passed the column's curve, (N,), cut to [-1, 1] for a thruster.

        Args:
            each: raw values of the inputs, (N,) each.
            column: with the weights.
            name: canonical name of the column.
            where: of the file, for messages.
            result: takes the notes.
        """
        inside = [self._convert(raw, column, name, where, result, last=False) for raw in each]
        total = sum(weight * x for (_, weight), x in zip(column.more.mix, inside, strict=True))
        total = np.asarray(total) * column.scale + column.offset
        return np.clip(total, -1.0, 1.0) if name.startswith("thruster_") else total

    def convert(
        self, raw: NDArray[Any], column: Column, name: str, where: str, result: Table
    ) -> NDArray[Any]:
        """Return a column's values in its own unit: curve, scale, offset and unit applied; notes go to `result`.

        Args:
            raw: values as they stand in the file, (N,).
            column: how they are converted.
            name: canonical name of the column.
            where: of the file, for messages.
            result: takes the notes.
        """
        return self._convert(raw, column, name, where, result)

    def _convert(
        self, raw: NDArray[Any], column: Column, name: str, where: str, result: Table, last: bool = True
    ) -> NDArray[Any]:
        raw = column.more.in_si(raw)
        if column.neutral is None and column.scale == 1.0 and column.offset == 0.0:
            return raw
        values = raw.astype(np.float64)
        if column.neutral is not None:
            silent = (values <= 0.0) | (values == _NO_SIGNAL)
            if silent.any() and column.neutral > 0.0:
                values[silent] = np.nan
                words = f"values of '{column.source}' that mean no signal (0, 65535) read as missing"
                result.repairs.append(Repair(words, where, int(silent.sum())))
            values = (values - column.neutral) / column.span
            beyond = int((np.abs(values) > 1.0).sum())
            if beyond:
                words = f"commands of '{name}' beyond neutral plus or minus span cut to [-1, 1]"
                result.repairs.append(Repair(words, where, beyond, "warning", "give the curve its true span"))
                values = np.clip(values, -1.0, 1.0)
        return values * column.scale + column.offset if last else values

    def _units(self, table: Table) -> None:
        degree = math.pi / 180.0
        fins = tuple(n for n in table.columns if n.startswith("fin_") and is_canonical(n))
        for unit, names in ((self.angles, EULER + fins), (self.rates, _RATES)):
            for name in names if unit == "deg" else ():
                # A column that states its own unit is in radians by now.
                own = name in self.columns and self.columns[name].more.factor is not None
                if name in table.columns and not own:
                    table.columns[name] = table.columns[name] * degree
        if self.quaternion == "xyzw" and all(n in table.columns for n in QUATERNION):
            x, y, z, w = (table.columns[n] for n in QUATERNION)
            table.columns.update(zip(QUATERNION, (w, x, y, z), strict=True))

    def seconds(self, values: NDArray[Any], already: bool, first: Any = None) -> NDArray[np.float64]:
        """Return the column `t` in seconds, (N,).

        Args:
            values: of the column, (N,).
            already: whether they are seconds.
            first: integers in a finer unit are counted from this one; from the first of `values` where None.
        """
        factor = 1.0 if already else _TIME_UNITS[self.time_unit]
        if values.dtype != np.float64:
            # Subtracting first keeps the digits that a float64 of the date would lose.
            values = (values - (values[0] if first is None else first)).astype(np.float64)
        return values * factor


def _build(data: dict[str, Any], where: str) -> Mapping:
    _known(data, _KEYS, where)
    frame = _section(data, "frame", where)
    _known(frame, ("body", "world"), f"{where}: frame")
    time = data.get("time", {})
    time = {"unit": time} if isinstance(time, str) else _section(data, "time", where)
    _known(time, ("unit",), f"{where}: time")
    columns = {name: _column(name, value, where) for name, value in _section(data, "columns", where).items()}
    return Mapping(
        columns=columns,
        body=_one_of(frame.get("body", "FRD"), ("FRD", "FLU"), f"{where}: frame: body"),
        world=_one_of(frame.get("world", "NED"), ("NED", "ENU"), f"{where}: frame: world"),
        angles=_one_of(data.get("angles", "rad"), ("rad", "deg"), f"{where}: angles"),
        rates=_one_of(data.get("rates", "rad"), ("rad", "deg"), f"{where}: rates"),
        quaternion=_one_of(data.get("quaternion", "wxyz"), ("wxyz", "xyzw"), f"{where}: quaternion"),
        time_unit=_one_of(time.get("unit", "s"), tuple(_TIME_UNITS), f"{where}: time: unit"),
        run=_run(data.get("run"), where),
        where=where,
        core=_core(data.get("core"), where),
        **mapping_more.sections(data, where),
    )
