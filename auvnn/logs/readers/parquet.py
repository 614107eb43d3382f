"""Parquet tables: typed, compact, and exact to the last bit."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from auvnn.errors import InputError
from auvnn.logs.readers.base import Reader, Table
from auvnn.logs.readers.frame import clean_names, to_table
from auvnn.logs.readers.memory import refuse_more_than_memory
from auvnn.logs.writing import HASH_KEY, frame_hash

_MAGIC = b"PAR1"


class ParquetReader(Reader):
    """Parquet files; those written by `Log.write` are checked against their own hash."""

    name = "parquet"
    suffixes = (".parquet", ".pq")

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as Parquet does."""
        return head.startswith(_MAGIC)

    def read(self, path: Path) -> Table:
        """Read the whole file.

        Raises:
            InputError: it is cut short, damaged, too large or has no rows.
        """
        where = str(path)
        _refuse_truncated(path, where)
        try:
            rows = pl.scan_parquet(path).select(pl.len()).collect().item()
            schema = pl.read_parquet_schema(path)
            if rows == 0 or not schema:
                raise InputError(f"{where}: has no rows")
            # A damaged footer can promise any number of rows.
            refuse_more_than_memory(2 * 8 * rows * len(schema), where)
            frame = pl.read_parquet(path)
            stored = pl.read_parquet_metadata(path).get(HASH_KEY)
            if stored is not None and stored != frame_hash(frame):
                raise InputError(
                    f"{where}: the numbers differ from those that were written: damaged; copy it again"
                )
            names, notes = clean_names(frame.columns, where)
            frame.columns = names
            table = to_table(frame, where)
        except InputError:
            raise
        except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError, MemoryError) as problem:
            raise InputError(f"{where}: is a damaged Parquet file: {_one_line(problem)}") from None
        except BaseException as problem:
            # On some damage polars' Rust core panics, which is no Exception and must not end the program.
            if type(problem).__name__ != "PanicException":
                raise
            raise InputError(f"{where}: is a damaged Parquet file: {_one_line(problem)}") from None
        table.repairs[:0] = notes
        return table


def _refuse_truncated(path: Path, where: str) -> None:
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(max(0, size - 4))
            tail = stream.read(4)
    except OSError as problem:
        raise InputError(f"{where}: cannot be read: {problem}") from None
    if size < 12 or tail != _MAGIC:
        raise InputError(
            f"{where}: is cut short: a Parquet file ends with its table of contents; copy it again"
        )


def _one_line(problem: BaseException) -> str:
    return " ".join(str(problem).split())[:200]
