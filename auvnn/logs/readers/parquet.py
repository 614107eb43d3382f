"""Parquet tables: typed, compact, and exact to the last bit."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from datetime import UTC
from functools import lru_cache
from pathlib import Path

import polars as pl

from auvnn.errors import InputError
from auvnn.logs.readers import parquet_pages
from auvnn.logs.readers.base import Reader, Table, Text
from auvnn.logs.readers.file_bytes import excerpt
from auvnn.logs.readers.frame import clean_names, damage_told, to_table
from auvnn.logs.readers.memory import refuse_more_than_memory
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.writing import HASH_KEY, frame_bytes, frame_hash

_DAMAGED = "{}: the numbers differ from those that were written: damaged; copy it again"
_UNREADABLE = "is a damaged Parquet file"
_AT_ONCE = 4_000_000  # rows of one column in memory at a time


class ParquetReader(Reader):
    """Parquet files; those written by `Log.write` are checked against their own hash."""

    name = "parquet"
    suffixes = (".parquet", ".pq")

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as Parquet does."""
        return head.startswith(parquet_pages.MAGIC)

    def read(self, path: Path) -> Table:
        """Read the whole file.

        Raises:
            InputError: it is cut short, damaged, too large or has no rows.
        """
        return self.read_head(path, 1.0)

    def read_head(self, path: Path, share: float) -> Table:
        """Read a share of the rows; the hash of the whole is checked only where all of it is read."""
        where = str(path)
        whole = share >= 1.0
        data = _all_of(path, where) if whole else b""
        contents = parquet_pages.check_bytes(data, where) if whole else parquet_pages.check(path)
        if contents.rows == 0 or not contents.flat:
            raise InputError(f"{where}: has no rows")
        names, notes = clean_names(contents.flat, where)
        rows = max(1, int(share * contents.rows))
        refuse_more_than_memory(int(share * contents.bytes) + 8 * rows * len(contents.flat), where)
        with damage_told(where, _UNREADABLE):
            if whole:
                frame = pl.read_parquet(data, columns=contents.flat)
                digest = hashlib.sha256(data).hexdigest()
            else:
                with excerpt(path, contents.ranges(0, rows, path.stat().st_size, contents.flat)) as source:
                    frame = pl.read_parquet(source, columns=contents.flat, n_rows=rows, glob=False)
                digest = ""
            stored = contents.notes.get(HASH_KEY) if whole else None
            if stored is not None and stored != frame_hash(frame):
                raise InputError(_DAMAGED.format(where))
            frame.columns = names
            if "" in names:
                frame = frame.drop("")
                cure = "name it in the program that writes the file"
                notes.append(Repair("column without a name left out", where, 1, "warning", cure))
            text = {name: Text("it holds lists or records") for name in contents.nested}
            table = to_table(frame, where, text)
        table.repairs[:0] = notes
        table.sha256, table.checked = digest, stored is not None or contents.summed
        return table

    def verify(self, path: Path) -> None:
        """Compare the numbers with the hash that `Log.write` left in the file, column by column.

        Raises:
            InputError: they differ.
        """
        contents = _contents(path)
        stored = contents.notes.get(HASH_KEY)
        if stored is None:
            return
        digest = hashlib.sha256()
        with damage_told(str(path), _UNREADABLE):
            for name in contents.flat:
                digest.update(name.encode())
                for first in range(0, contents.rows, _AT_ONCE):
                    count = min(_AT_ONCE, contents.rows - first)
                    with self._rows(path, contents, first, count, [name]) as lazy:
                        part = lazy.select(name).slice(first, count).collect()
                    digest.update(frame_bytes(part[name]))
        if digest.hexdigest() != stored:
            raise InputError(_DAMAGED.format(path))

    @staticmethod
    @contextlib.contextmanager
    def _rows(
        path: Path, contents: parquet_pages.Contents, first: int, count: int, columns: list[str] | None = None
    ) -> Iterator[pl.LazyFrame]:
        """Give a table in which some rows can be read: a copy that nobody can cut short meanwhile."""
        wanted = contents.flat if columns is None else columns
        with excerpt(path, contents.ranges(first, count, path.stat().st_size, wanted)) as source:
            yield pl.scan_parquet(source, glob=False)

    def rows(self, path: Path) -> int:
        """Return the number of rows that the file's table of contents states, once it has been checked.

        Raises:
            InputError: it is cut short or damaged.
        """
        return _contents(path).rows

    def read_rows(self, path: Path, first: int, count: int) -> Table:
        """Read some of the rows, and no more of the file than the row groups that hold them.

        The file's own hash covers all rows and is not looked at here.

        Raises:
            InputError: it is damaged, or a column of dates has none in its first row.
        """
        where = str(path)
        contents = _contents(path)
        with damage_told(where, _UNREADABLE), self._rows(path, contents, first, count) as lazy:
            schema = lazy.collect_schema()
            nested = [n for n, kind in schema.items() if kind.is_nested()]
            flat = [n for n in schema.names() if n not in nested]
            names, _ = clean_names(flat, where)
            dates = [n for n, kind in schema.items() if kind.is_temporal() and kind != pl.Time]
            frame = lazy.select(flat).slice(first, count).collect()
            if dates:
                # Seconds are counted from the first row of a table: it is put in front, and taken away again.
                with self._rows(path, contents, 0, 1) as opening:
                    head = opening.select(flat).slice(0, 1).collect()
                if any(head[n].null_count() for n in dates):
                    raise InputError(
                        f"{where}: column '{dates[0]}' has no time in its first row: leave that row out"
                    )
                frame = pl.concat([head, frame])
            frame.columns = names
            if "" in names:
                frame = frame.drop("")
            table = to_table(frame, where, {name: Text("it holds lists or records") for name in nested})
        if dates:
            table.columns = {name: column[1:] for name, column in table.columns.items()}
            table.text = {name: column[1:] for name, column in table.text.items()}
            table.rows -= 1
        return table

    def first_stamp(self, path: Path, column: str) -> float | None:
        """Return the date in a column's first row, s since 1970; None where the column holds no dates.

        Raises:
            InputError: it is damaged.
        """
        with damage_told(str(path), _UNREADABLE), self._rows(path, _contents(path), 0, 1) as lazy:
            kind = lazy.collect_schema().get(column)
            if kind is None or kind not in (pl.Date, pl.Datetime):
                return None
            first = lazy.select(pl.col(column).cast(pl.Datetime("us"))).head(1).collect()[column][0]
        return None if first is None else first.replace(tzinfo=UTC).timestamp()


def _all_of(path: Path, where: str) -> bytes:
    try:
        refuse_more_than_memory(path.stat().st_size, where)
        return path.read_bytes()
    except OSError as problem:
        raise InputError(f"{where}: cannot be read: {problem}") from None


def _contents(path: Path) -> parquet_pages.Contents:
    """Return what a file's table of contents says; that of the last few files is kept until they change."""
    try:
        state = path.stat()
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem}") from None
    return _checked(str(path), state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=8)
def _checked(path: str, size: int, changed: int) -> parquet_pages.Contents:
    return parquet_pages.check(Path(path))
