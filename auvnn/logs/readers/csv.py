"""Comma-separated values, in all the shapes in which spreadsheets and loggers write them."""

from __future__ import annotations

import re
from pathlib import Path

import polars as pl

from auvnn.errors import InputError
from auvnn.logs.readers.base import Reader, Table, Text
from auvnn.logs.readers.dialect import Plain, settle
from auvnn.logs.readers.frame import damage_told, numbers_from_text, to_table
from auvnn.logs.readers.memory import refuse_more_than_memory

_NULLS = ["", "-", "NaN", "nan", "null"]
_LONG_INTEGER = re.compile(rb"[+-]?\d{16,19}")


class CsvReader(Reader):
    """Text tables with a header line; encoding, separator and decimal sign are found out."""

    name = "csv"
    suffixes = (".csv", ".txt", ".tsv", ".dat")

    def recognises(self, head: bytes) -> bool:
        """Say whether these bytes are text."""
        if head.startswith((b"\xff\xfe", b"\xfe\xff")):
            return True
        control = sum(byte < 32 and byte not in (9, 10, 12, 13) for byte in head)
        return control <= 0.002 * len(head) and not head.startswith(b"PAR1")

    def read(self, path: Path) -> Table:
        """Read the whole file.

        Raises:
            InputError: it has no header, no rows, a number too large, or is damaged.
        """
        return self.read_head(path, 1.0)

    def read_head(self, path: Path, share: float) -> Table:
        """Read a share of the bytes, up to the last whole line of them."""
        where = str(path)
        try:
            size = int(share * path.stat().st_size)
            # The text, its copy with one kind of line end, and the numbers live at the same time.
            refuse_more_than_memory(3 * size, where)
            plain = settle(_beginning(path, size) if share < 1.0 else path.read_bytes(), where)
        except OSError as problem:
            raise InputError(f"{where}: cannot be read: {problem}") from None
        frame, text = _parse(plain, where)
        table = to_table(frame, where, text)
        table.repairs[:0] = plain.repairs
        return table


def _beginning(path: Path, size: int) -> bytes:
    """Return the whole lines in the first `size` bytes; all of a file whose lines are not bytes (UTF-16)."""
    with path.open("rb") as stream:
        data = stream.read(size)
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return data + stream.read()
    end = max(data.rfind(b"\n"), data.rfind(b"\r"))
    return data if end < 0 else data[:end] + b"\n"


def _parse(plain: Plain, where: str) -> tuple[pl.DataFrame, dict[str, Text]]:
    # Columns without a name need one while they are read; no file can hold this one.
    names = [name or f"\x01{i}" for i, name in enumerate(plain.names)]
    unwanted = [name for name in names if name.startswith("\x01")]
    what = "is no table of numbers"
    if plain.body.count(b'"') % 2:
        what += " (a quotation mark is opened and not closed)"
    try:
        with damage_told(where, what):
            frame = _numbers(plain, names).drop(unwanted)
        infinite = [s.name for s in frame if s.dtype == pl.Float64 and s.is_infinite().any()]
        if not infinite:
            return frame, {}
    except InputError:
        pass
    with damage_told(where, what):
        frame = pl.read_csv(
            plain.body, has_header=False, new_columns=names, separator=plain.separator, infer_schema=False
        ).drop(unwanted)
    columns: list[pl.Series] = []
    text: dict[str, Text] = {}
    for series in frame:
        value = numbers_from_text(series, plain.decimal_comma, where, plain.first_line)
        if isinstance(value, Text):
            text[series.name] = value
        else:
            columns.append(value)
    return pl.DataFrame(columns), text


def _numbers(plain: Plain, names: list[str]) -> pl.DataFrame:
    """Read a file that holds nothing but numbers and the usual signs for a missing one: the fast way."""
    first = plain.body.partition(b"\n")[0].split(plain.separator.encode())
    whole = {n for n, cell in zip(names, first, strict=False) if _LONG_INTEGER.fullmatch(cell.strip())}
    return pl.read_csv(
        plain.body,
        has_header=False,
        schema={n: pl.Int64 if n in whole else pl.Float64 for n in names},
        null_values=_NULLS,
        separator=plain.separator,
        decimal_comma=plain.decimal_comma,
    )
