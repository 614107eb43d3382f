"""From a polars table to a table of plain numbers, with missing and unusable cells counted."""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from collections.abc import Iterator

import numpy as np
import polars as pl

from auvnn.errors import InputError, one_line
from auvnn.logs.readers.base import Table, Text
from auvnn.logs.reading.repairs.repair import Repair

MISSING = ("", "-", "--", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "+inf", "-inf", "infinity", "?")
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_MAX_BAD = 0.01  # above this share of unreadable cells a column is text, not a damaged number
_MAX_LABELS = 10_000
MOST_COLUMNS = 20_000
_EXACT = 2**53  # integers beyond it do not fit a float64
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


@contextlib.contextmanager
def damage_told(where: str, what: str) -> Iterator[None]:
    """Turn what polars raises on a damaged file into one line.

    Args:
        where: the file.
        what: what is wrong with it, such as "is a damaged Parquet file".

    Raises:
        InputError: polars could not read the file.
    """
    try:
        yield
    except InputError:
        raise
    except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError, MemoryError) as problem:
        words = one_line(str(problem).split("\n")[0], 200)
        raise InputError(f"{where}: {what}: {words}") from None
    except BaseException as problem:
        # On some damage polars' Rust core panics, which is no Exception and must not end the program.
        if type(problem).__name__ != "PanicException":
            raise
        raise InputError(f"{where}: {what}: {one_line(problem, 200)}") from None


def clean_names(names: list[str], where: str) -> tuple[list[str], list[Repair]]:
    """Return the column names without blanks around them and without control characters.

    Raises:
        InputError: a name occurs twice, or there are more than any log has.
    """
    if len(names) > MOST_COLUMNS:
        raise InputError(
            f"{where}: has {len(names)} columns; a log has at most {MOST_COLUMNS}: is this its header line?"
        )
    cleaned = [_CONTROL.sub("?", name).strip() for name in names]
    strange = sum(_CONTROL.search(name) is not None for name in names)
    twice = sorted(n for n, times in Counter(cleaned).items() if n and times > 1)
    if twice:
        raise InputError(
            f"{where}: the columns {', '.join(map(repr, twice))} occur twice; rename one of each"
        )
    note = Repair("control characters in column names replaced by '?'", where, strange)
    return cleaned, [note] if strange else []


def numbers_from_text(
    series: pl.Series, decimal_comma: bool, where: str, first_line: int
) -> pl.Series | Text:
    """Return the column as Float64, null where a cell is empty or unreadable, or as text.

    Args:
        series: a column as text.
        decimal_comma: a comma parts whole numbers from decimals.
        where: of the file, for messages.
        first_line: line of the file in which the column's first cell is.

    Raises:
        InputError: a cell is a number too large for a float64.
    """
    text = series.str.strip_chars()
    text = text.set(text.str.to_lowercase().is_in(list(MISSING)), None)
    if decimal_comma:
        text = text.str.replace(",", ".", literal=True)
    value = text.cast(pl.Float64, strict=False)
    refuse_overflow(value, where, series.name, first_line)
    bad = text.is_not_null() & value.is_null()
    n_bad = int(bad.sum())
    if not n_bad:
        return value
    row = int(bad.arg_true()[0])
    cell = str(text[row])[:40]
    words = f"line {first_line + row} says {cell!r}"
    if n_bad > _MAX_BAD * max(int(text.is_not_null().sum()), 1):
        return _labels(text, words)
    return value.alias(f"{series.name}\0{n_bad}\0{words}")


def refuse_overflow(value: pl.Series, where: str, name: str, first_line: int) -> None:
    """Refuse a column with a cell that no float64 can hold.

    Args:
        value: a column as Float64.
        where: of the file, for messages.
        name: of the column.
        first_line: line of the file in which the column's first cell is.

    Raises:
        InputError: with the line of the first such cell.
    """
    infinite = value.is_infinite().fill_null(False)
    if infinite.any():
        line = first_line + int(infinite.arg_true()[0])
        raise InputError(f"{where}: column '{name}', line {line}: the number is too large for a float64")


def to_table(frame: pl.DataFrame, where: str, text: dict[str, Text] | None = None) -> Table:
    """Return the columns of a polars table as numpy arrays.

    Numbers become float64 with NaN for null, NaN and infinity, all counted; integers that a float64
    cannot hold stay int64; dates and durations become seconds; everything else becomes text.

    Args:
        frame: the columns; notes on a column stand behind a null character in its name.
        where: of the file, for messages.
        text: columns that are text already.
    """
    table = Table({}, frame.height, dict(text or {}))
    missing = 0
    for series in frame:
        name, _, note = series.name.partition("\0")
        if note:
            count, _, words = note.partition("\0")
            what = f"cells of '{name}' that are no numbers read as missing (the first: {words})"
            table.repairs.append(Repair(what, where, int(count), "warning", "correct the cells in the file"))
        values = _array(series, name, table)
        if values is None:
            continue
        if values.dtype == np.float64:
            absent = ~np.isfinite(values)
            missing += int(absent.sum())
            values[absent] = np.nan
        table.columns[name] = values
    if missing:
        words = "cells that hold no number (empty, NaN, infinite) read as missing"
        table.repairs.append(Repair(words, where, missing, "info"))
    return table


def _array(series: pl.Series, name: str, table: Table) -> np.ndarray | None:
    kind = series.dtype
    if kind.is_temporal() and kind != pl.Time:
        table.seconds.add(name)
        return _seconds(series)
    if kind.is_integer() and series.null_count() == 0 and series.len():
        low, high = int(series.min()), int(series.max())  # type: ignore[arg-type]
        if max(-low, high) > _EXACT and high < 2**63:
            return series.cast(pl.Int64).to_numpy().copy()
    if kind.is_numeric() or kind in (pl.Boolean, pl.Null):
        return np.array(series.cast(pl.Float64).to_numpy(), dtype=np.float64)
    if kind in (pl.String, pl.Categorical, pl.Enum):
        as_text = series.cast(pl.String)
        value = numbers_from_text(as_text, False, name, 1)
        if isinstance(value, pl.Series) and "\0" not in value.name:
            return np.array(value.to_numpy(), dtype=np.float64)
        table.text[name] = value if isinstance(value, Text) else _labels(as_text, value.name.split("\0")[-1])
    else:
        table.text[name] = Text(f"it holds {kind}")
    return None


def _seconds(series: pl.Series) -> np.ndarray:
    # Counted from the first stamp: nanoseconds since 1970 do not fit a float64.
    ticks = series.cast(pl.Datetime("ns")) if series.dtype == pl.Date else series
    per_second = {"ms": 1e3, "us": 1e6, "ns": 1e9}[getattr(ticks.dtype, "time_unit", "ns") or "us"]
    whole = ticks.to_physical().cast(pl.Int64)
    first = whole.drop_nulls().first()
    return np.array(((whole - first).cast(pl.Float64) / per_second).to_numpy(), dtype=np.float64)


def _labels(text: pl.Series, words: str) -> Text:
    unique = text.drop_nulls().unique(maintain_order=True)
    if len(unique) > _MAX_LABELS:
        return Text(words)
    labels = unique.to_list()
    if not labels:
        return Text(words)
    codes = text.replace_strict(labels, list(range(len(labels))), default=-1, return_dtype=pl.Int64)
    return Text(words, codes.fill_null(-1).to_numpy().astype(np.intp), labels)
