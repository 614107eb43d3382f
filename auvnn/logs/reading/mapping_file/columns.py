"""The entries of a mapping file: one column, a core, a run, each checked as it is read."""

from __future__ import annotations

import math
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from typing import Any

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError
from auvnn.logs.channels import FIXED, is_canonical
from auvnn.logs.reading.mapping_file import mapping_more
from auvnn.logs.reading.mapping_file.mapping_more import More
from auvnn.logs.reading.repairs.validity import Validity

_COLUMN_KEYS = ("from", "scale", "offset", "curve", "delay", "value", "valid", "by", *mapping_more.KEYS)


_LONGEST_DELAY = 60.0  # s


@dataclass(frozen=True)
class Column:
    """How one canonical column is made: from a column of the file, from one for each core, or a constant."""

    source: str | None
    scale: float = 1.0
    offset: float = 0.0
    neutral: float | None = None
    span: float = 1.0
    value: float = 0.0
    delay: float = 0.0
    cores: tuple[str, ...] = ()
    by: str | None = None
    valid: Validity | None = None
    more: More = field(default_factory=More)


def _core(value: Any, where: str) -> tuple[str, str] | None:
    if value is None:
        return None
    if not isinstance(value, MappingType):
        raise ConfigError(f"{where}: core must be {{column: ..., primary: ...}}, not {value!r}")
    _known(value, ("column", "primary"), f"{where}: core")
    pair = value.get("column"), value.get("primary")
    if not all(isinstance(name, str) for name in pair):
        raise ConfigError(f"{where}: core: 'column' and 'primary' must name columns of the file")
    return str(pair[0]), str(pair[1])


def _run(value: Any, where: str) -> str | None:
    if isinstance(value, MappingType):
        _known(value, ("from",), f"{where}: run")
        value = value.get("from")
        if not isinstance(value, str):
            raise ConfigError(f"{where}: run: 'from' must name a column, not {value!r}")
        return value
    if value is None or value == "file":
        return value
    raise ConfigError(f"{where}: run: {value!r} is neither {{from: column}} nor 'file' (one run per file)")


def _column(name: str, value: Any, where: str) -> Column:
    here = f"{where}: columns: {name}"
    if not is_canonical(name):
        numbered = ("thruster_1", "fin_1")
        raise ConfigError(f"{where}: columns: {unknown_name('canonical column', name, (*FIXED, *numbered))}")
    if isinstance(value, str):
        return Column(value)
    if not isinstance(value, MappingType):
        raise ConfigError(f"{here}: must name a column or say {{from: column, ...}}, not {value!r}")
    _known(value, _COLUMN_KEYS, here)
    if "value" in value:
        if len(value) > 1:
            raise ConfigError(f"{here}: 'value' is a constant and stands alone")
        return Column(None, value=_number(value["value"], f"{here}: value"))
    more = mapping_more.of_column(value, name, here)
    source, by = value.get("from", None if more.mix else name), value.get("by")
    several: tuple[str, ...] = ()
    if by is not None:
        if not (isinstance(source, list) and source and all(isinstance(s, str) for s in source)):
            raise ConfigError(f"{here}: with 'by', 'from' must list one column for each core, [u_0, u_1]")
        if not isinstance(by, str):
            raise ConfigError(f"{here}: 'by' must name the column that says which core is in use, not {by!r}")
        several, source = tuple(source), source[0]
    if not isinstance(source, str) and not more.mix:
        raise ConfigError(f"{here}: 'from' must be a column's name, not {source!r}")
    valid = Validity.read(value["valid"], f"{here}: valid") if "valid" in value else None
    numbers: dict[str, float] = {
        k: _number(value[k], f"{here}: {k}") for k in ("scale", "offset", "delay") if k in value
    }
    if abs(numbers.get("delay", 0.0)) > _LONGEST_DELAY:
        raise ConfigError(
            f"{here}: delay: {numbers['delay']:g} s is beyond {_LONGEST_DELAY:g} s; give seconds"
        )
    if "delay" in numbers and name in ("t", "run"):
        raise ConfigError(f"{here}: '{name}' takes no delay: give it to the columns that are late")
    if numbers.get("scale") == 0.0:
        raise ConfigError(f"{here}: scale: 0 would wipe the column out; use 'value: 0' for a constant")
    if "curve" in value:
        curve = value["curve"]
        if not isinstance(curve, MappingType):
            raise ConfigError(f"{here}: curve must be {{neutral: ..., span: ...}}, not {curve!r}")
        _known(curve, ("neutral", "span"), f"{here}: curve")
        for key in ("neutral", "span"):
            if key not in curve:
                raise ConfigError(f"{here}: curve needs '{key}'")
            numbers[key] = _number(curve[key], f"{here}: curve: {key}")
        if numbers["span"] == 0.0:
            raise ConfigError(f"{here}: curve: span must not be 0")
    return Column(source, **numbers, cores=several, by=by, valid=valid, more=more)


def _section(data: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    value = data.get(key)
    if value is None:
        return {}
    if not isinstance(value, MappingType):
        raise ConfigError(f"{where}: '{key}' must hold `name: value` lines, not {value!r}")
    return dict(value)


def _known(data: MappingType[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in data:
        if key not in keys:
            raise ConfigError(f"{where}: {unknown_name('key', str(key), keys)}")


def _one_of(value: Any, choices: tuple[str, ...], where: str) -> str:
    if value not in choices:
        raise ConfigError(f"{where}: {unknown_name('choice', str(value), choices)}")
    return str(value)


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigError(f"{where}: {value!r} is not a finite number")
    return float(value)
