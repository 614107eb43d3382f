"""Check a Parquet file's own counts and checksums before anything is decoded.

A decoder believes the counts in the footer and in the page headers and reserves memory for them; on
damage that ends the whole process, which no `except` can catch. Here every count is compared with the
others and every checksum with its page. The structures are those of the parquet-format specification.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from auvnn.errors import InputError
from auvnn.logs.readers.file_bytes import FileBytes
from auvnn.logs.readers.thrift import Cursor, Struct, ThriftError

MAGIC = b"PAR1"
_MAX_ROWS = 2**40
_HEADER = 2048
_DATA, _DICTIONARY, _DATA_V2 = 0, 2, 3
# By their numbers in the format; LZO is in the specification and nearly nobody reads it.
_CODECS = {0: "none", 1: "snappy", 2: "gzip", 3: "LZO", 4: "brotli", 5: "lz4", 6: "zstd", 7: "lz4_raw"}
_UNREADABLE = ("LZO",)


@dataclass(frozen=True)
class Contents:
    """What the footer says.

    Args:
        rows: number of rows.
        flat: names of the columns that hold one value per row.
        nested: names of those that hold lists or records.
        bytes: size of all pages when unpacked.
        groups: of each row group, the number of its rows.
        places: of each flat column, the range of its bytes in each row group.
        footer: first byte of the table of contents.
        notes: what the writer noted, by key.
        summed: whether every page carries a checksum, all of which have been compared.
    """

    rows: int
    flat: list[str]
    nested: list[str]
    bytes: int
    groups: tuple[int, ...] = ()
    places: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    footer: int = 0
    notes: dict[str, str] = field(default_factory=dict)
    summed: bool = False

    def ranges(self, first: int, count: int, size: int, columns: Sequence[str]) -> list[tuple[int, int]]:
        """Return the ranges of bytes, in a file of some size, that a decoder needs for some rows of some columns.

        Args:
            first: number of the first row, from 0.
            count: of rows.
            size: of the file, bytes.
            columns: that are read.
        """
        found, at = [(0, len(MAGIC)), (self.footer, size)], 0
        for k, rows in enumerate(self.groups):
            if at < first + count and first < at + rows:
                found += [self.places[name][k] for name in columns]
            at += rows
        return found


def check(path: Path) -> Contents:
    """Return what a Parquet file holds, after its counts and checksums have been compared; it is not mapped.

    Raises:
        InputError: it is cut short or damaged.
    """
    where = str(path)
    try:
        with path.open("rb") as stream:
            return check_bytes(FileBytes(stream, where), where)
    except OSError as problem:
        raise InputError(f"{where}: cannot be read: {problem}") from None


def check_bytes(data: bytes | FileBytes, where: str) -> Contents:
    """Return the same of the bytes of a file.

    Raises:
        InputError: as `check`.
    """
    size = len(data)
    if size < 12:
        raise InputError(f"{where}: is cut short: {size} bytes are no Parquet file; copy it again")
    try:
        return _check(data, size, where)
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as problem:
        # Fields of another type than they must have raise these; any of them means damage.
        raise InputError(f"{where}: is a damaged Parquet file ({problem}); copy it again") from None


def _check(data: bytes | FileBytes, size: int, where: str) -> Contents:
    tail = data[size - 8 : size]
    if tail[4:] == b"PARE":
        raise InputError(f"{where}: is an encrypted Parquet file; save it without encryption")
    if tail[4:] != MAGIC:
        raise InputError(f"{where}: is cut short: the table of contents at its end is missing; copy it again")
    start = size - 8 - int.from_bytes(tail[:4], "little")
    if start < 4:
        raise ThriftError("its table of contents is larger than the file")
    footer = data[start : size - 8]
    meta = Cursor(footer, 0, len(footer)).struct()
    rows, groups = meta[3], meta[4]
    if not 0 <= rows < _MAX_ROWS or sum(group[3] for group in groups) != rows:
        raise ThriftError("the number of rows is not that of its parts")
    total, summed = 0, True
    places: dict[str, list[tuple[int, int]]] = {}
    for group in groups:
        for chunk in group[1]:
            _refuse_codec(chunk, where)
            unpacked, every = _check_chunk(data, chunk, group[3], start)
            total, summed = total + unpacked, summed and every
            meta_of = chunk[3]
            begin = min(p for p in (meta_of[9], meta_of.get(11, 0)) if p > 0)
            if not 0 <= meta_of[7] <= start - begin:
                raise ThriftError("a column lies outside the file")
            if len(meta_of[3]) == 1:
                places.setdefault(meta_of[3][0].decode(), []).append((begin, begin + meta_of[7]))
    flat, nested = _columns(meta[2])
    notes = {
        e[1].decode("utf-8", "replace"): e.get(2, b"").decode("utf-8", "replace") for e in meta.get(5, [])
    }
    if any(len(places.get(name, [])) < len(groups) for name in flat):
        raise ThriftError("a column is missing in a part of the file")
    return Contents(rows, flat, nested, total, tuple(int(group[3]) for group in groups), places, start, notes,
                    summed)  # fmt: skip


def _refuse_codec(chunk: Struct, where: str) -> None:
    """Refuse a compression that the decoder does not know, before it calls the file damaged."""
    meta = chunk[3]
    codec = _CODECS.get(meta[4], f"method {meta[4]}")
    if codec in _UNREADABLE or meta[4] not in _CODECS:
        name = ".".join(part.decode() for part in meta[3])
        raise InputError(
            f"{where}: column '{name}' is compressed by {codec}, which auvnn cannot unpack: "
            "save the file with zstd or snappy"
        )


def _columns(schema: list[Struct]) -> tuple[list[str], list[str]]:
    flat, nested = [], []
    root, i = schema[0].get(5, 0), 1
    for _ in range(root):
        element = schema[i]
        repeated = element.get(3, 0) == 2
        (nested if element.get(5, 0) or repeated else flat).append(element[4].decode())
        i = _after(schema, i)
    return flat, nested


def _after(schema: list[Struct], i: int) -> int:
    """Return the index behind a schema element and all that is below it."""
    pending = 1
    while pending:
        pending += schema[i].get(5, 0) - 1
        i += 1
        if pending < 0:
            raise ThriftError("its schema is no tree")
    return i


def _check_chunk(data: bytes | FileBytes, chunk: Struct, rows: int, end: int) -> tuple[int, bool]:
    """Return the size of a column when unpacked, and whether all its pages carry checksums."""
    meta = chunk[3]
    values, unpacked = meta[5], meta[6]
    flat = len(meta[3]) == 1
    if rows < 0 or values < 0 or unpacked < 0 or (flat and values != rows):
        raise ThriftError("a column has another number of values than rows")
    dictionary = meta.get(11, 0)
    place = min(p for p in (meta[9], dictionary) if p > 0)
    seen, summed = 0, True
    while seen < values:
        if not 4 <= place < end:
            raise ThriftError("a page lies outside the file")
        header, behind = _page_header(data, place, end)
        count = _check_page(data, header, behind, end, unpacked)
        summed = summed and 4 in header
        if header[1] in (_DATA, _DATA_V2):
            if count == 0:
                raise ThriftError("a page is empty")
            seen += count
        place = behind + header[3]
    if seen != values:
        raise ThriftError("the pages of a column hold another number of values than the column")
    return int(unpacked), summed


def _page_header(data: bytes | FileBytes, place: int, end: int) -> tuple[Struct, int]:
    """Return the header of the page that begins at a place, and the place behind it."""
    for most in (_HEADER, end - place):  # a header holds statistics, which may be long texts
        part = data[place : min(place + most, end)]
        cursor = Cursor(part, 0, len(part))
        try:
            return cursor.struct(), place + cursor.place
        except ThriftError:
            if place + most >= end:
                raise
    raise ThriftError("a page has no header")


def _check_page(data: bytes | FileBytes, header: Struct, place: int, end: int, most: int) -> int:
    """Return the number of values that a page header promises, after all its numbers have been compared."""
    unpacked, packed = header[2], header[3]
    if not (0 <= packed <= end - place and 0 <= unpacked <= max(most, packed)):
        raise ThriftError("a page is larger than its column")
    if 4 in header and zlib.crc32(data[place : place + packed]) != header[4] & 0xFFFFFFFF:
        raise ThriftError("a page's checksum is wrong")
    if header[1] == _DATA_V2:
        page = header[8]
        levels = page[5] + page[6]
        if not (0 <= page[2] <= page[1] and 0 <= page[3] <= page[1] and min(page[5], page[6]) >= 0):
            raise ThriftError("a page's counts contradict each other")
        if levels > packed:
            raise ThriftError("a page's levels are larger than the page")
    elif header[1] == _DATA:
        page = header[5]
    elif header[1] == _DICTIONARY:
        page = header[7]
        if page[1] > unpacked:
            raise ThriftError("a dictionary has more entries than bytes")
    else:
        return 0
    count = page[1]
    if not 0 <= count < _MAX_ROWS:
        raise ThriftError("a page has an impossible number of values")
    return int(count)
