"""The many shapes of a CSV file brought to one: UTF-8, line feeds, one header line, rows of equal length."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field

import numpy as np

from auvnn.errors import InputError
from auvnn.logs.readers.frame import MISSING, clean_names
from auvnn.logs.reading.repairs.repair import Repair

_SEPARATORS = (";", "\t", ",", "|")
_MAX_DAMAGED = 0.05
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")


@dataclass
class Plain:
    """A CSV file after everything about its shape has been settled.

    Args:
        body: the rows, UTF-8, line feeds, without header.
        names: one name per column; an empty name is a column to be dropped.
        separator: between cells.
        decimal_comma: whether numbers are written 1,5.
        first_line: number of the first row's line in the file.
        repairs: what was settled.
    """

    body: bytes
    names: list[str]
    separator: str
    decimal_comma: bool
    first_line: int
    repairs: list[Repair] = field(default_factory=list)


def settle(data: bytes, where: str) -> Plain:
    """Bring the bytes of a CSV file to one plain shape, noting everything that was not so.

    Raises:
        InputError: it has no header, no rows, names that occur twice, or too many damaged rows.
    """
    repairs: list[Repair] = []
    data = _utf8(data, where, repairs)
    data = _line_feeds(data, where, repairs)
    if not data.endswith(b"\n"):
        # Many programs end their files so; a copy that was cut inside the last number looks the same.
        repairs.append(
            Repair("the last row has no line end: complete, unless the copy was cut", where, 1, "info")
        )
    header, body, first_line, separator = _header(data, where, repairs)
    separator = separator or _separator(header, where)
    names = _names(header, separator, where, repairs)
    body, damaged_head = _without_headers(body, header, where, repairs)
    sample = body[:65536].decode("utf-8", "replace")
    decimal_comma = separator != "," and re.search(r"\d,\d", sample) is not None
    if separator != "," or decimal_comma:
        shown = {"\t": "tab"}.get(separator, f"'{separator}'")
        comma = ", decimal comma" if decimal_comma else ""
        repairs.append(Repair(f"read with separator {shown}{comma}", where, 1, "info"))
    body, skipped = _without_units(body, separator, where, repairs)
    body, names = _equal_rows(body, names, separator, where, repairs)
    if not body.strip():
        raise InputError(f"{where}: has a header line but no rows")
    first_line += skipped + damaged_head
    return Plain(body, names, separator, decimal_comma, first_line, repairs)


def _utf8(data: bytes, where: str, repairs: list[Repair]) -> bytes:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeError as problem:
            raise InputError(f"{where}: starts like UTF-16 text and is not: {problem}") from None
        repairs.append(Repair("read as UTF-16 text", where, 1, "info"))
    elif data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
        repairs.append(Repair("byte order mark at the start left out", where, 1, "info"))
    zeros = data.count(b"\0")
    if zeros:
        raise InputError(
            f"{where}: holds {zeros} zero bytes: the file is damaged or is no text; export it again"
        )
    if not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:
            data = data.decode("latin-1").encode()
            repairs.append(Repair("not UTF-8: read as Latin-1", where, 1, "info"))
    return data


def _line_feeds(data: bytes, where: str, repairs: list[Repair]) -> bytes:
    returns = data.count(b"\r")
    if returns:
        both, feeds = data.count(b"\r\n"), data.count(b"\n")
        if not (both == returns == feeds or feeds == 0):
            repairs.append(Repair("line ends of different kinds made one", where, returns, "info"))
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def _header(data: bytes, where: str, repairs: list[Repair]) -> tuple[str, bytes, int, str]:
    start, line, comments, separator = 0, 1, 0, ""
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        text = data[start:end].decode("utf-8", "replace").strip(" ")
        start, line = end + 1, line + 1
        if text.lower().startswith("sep=") and len(text) == 5:
            separator = text[4]
        elif text.startswith("#"):
            comments += 1
        elif text.strip():
            if comments:
                repairs.append(Repair("comment lines before the header skipped", where, comments, "info"))
            return text, data[start:], line, separator
    raise InputError(f"{where}: holds no text but blank or comment lines")


def _separator(header: str, where: str) -> str:
    outside = re.sub(r'"[^"]*"', "", header)
    best = max(_SEPARATORS, key=outside.count)
    if outside.count(best) == 0:
        found = "blanks" if len(header.split()) > 1 else "nothing"
        raise InputError(
            f"{where}: the first line {header[:60]!r} has columns separated by {found}; "
            "a CSV file needs a header line with names separated by , ; | or tab"
        )
    return best


def _cells(line: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return [cell.strip() for cell in line.split(separator)]


def _is_missing(cell: str) -> bool:
    return cell.lower() in MISSING


def _names(header: str, separator: str, where: str, repairs: list[Repair]) -> list[str]:
    names = _cells(header, separator)
    if all(_NUMBER.fullmatch(n) or _is_missing(n) for n in names):
        raise InputError(
            f"{where}: has no header line: the first line is {header[:60]!r}; add the column names"
        )
    names, notes = clean_names(names, where)
    repairs.extend(notes)
    if names[0] == "" or names[0].lower() == "unnamed: 0":
        # What pandas writes when asked to keep its index: it says nothing about the vehicle.
        names[0] = ""
        repairs.append(Repair("first column without a name (a row index) left out", where, 1, "info"))
    if len(names) > 1 and names[-1] == "":
        repairs.append(Repair("separator at the end of the header ignored", where, 1, "info"))
    if "" in names[1:-1]:
        position = names.index("", 1) + 1
        raise InputError(f"{where}: column {position} has no name; name it in the header line")
    return names


def _without_headers(body: bytes, header: str, where: str, repairs: list[Repair]) -> tuple[bytes, int]:
    line = header.encode()
    leading = 0
    while body.startswith(line + b"\n"):
        body = body[len(line) + 1 :]
        leading += 1
    again = 0
    # Until none is left: a match eats the line feed that the next one needs.
    while found := body.count(b"\n" + line + b"\n"):
        body = body.replace(b"\n" + line + b"\n", b"\n")
        again += found
    if body.endswith(b"\n" + line):
        body, again = body[: -len(line)], again + 1
    if leading + again:
        what = "repeated header lines left out (logs joined into one file?)"
        repairs.append(Repair(what, where, leading + again))
    if b"\n\n" in body or b"\n " in body or body.startswith((b"\n", b" ")):
        body = re.sub(rb"^[ \t]*\n", b"", body, flags=re.MULTILINE)
    return body, leading


def _without_units(body: bytes, separator: str, where: str, repairs: list[Repair]) -> tuple[bytes, int]:
    line, _, rest = body.partition(b"\n")
    cells = _cells(line.decode("utf-8", "replace"), separator)
    filled = [c for c in cells if not _is_missing(c)]
    if filled and rest and not any(_NUMBER.fullmatch(c) for c in filled):
        after = _cells(rest.partition(b"\n")[0].decode("utf-8", "replace"), separator)
        if any(_NUMBER.fullmatch(c) for c in after):
            shown = line.decode("utf-8", "replace")[:60]
            repairs.append(
                Repair(f"line below the header without a number left out: {shown!r}", where, 1, "info")
            )
            return rest, 1
    return body, 0


def _equal_rows(
    body: bytes, names: list[str], separator: str, where: str, repairs: list[Repair]
) -> tuple[bytes, list[str]]:
    """Drop rows with too few or too many cells; a separator at the end of rows is no cell."""
    expected = len(names) - 1
    rows = body.count(b"\n") + (not body.endswith(b"\n") and bool(body))
    if b'"' in body or (body.count(separator.encode()) == expected * rows and names[-1] != ""):
        return body, names
    raw = np.frombuffer(body if body.endswith(b"\n") else body + b"\n", dtype=np.uint8)
    ends = np.flatnonzero(raw == 10)
    starts = np.concatenate([[0], ends[:-1] + 1])
    counts = np.add.reduceat(raw == ord(separator), starts, dtype=np.int32)
    trailing = (counts == expected + 1) & (raw[ends - 1] == ord(separator))
    if trailing.sum() > 0.5 * len(counts):
        # As many names as cells again: the last, nameless column is dropped after reading.
        names, expected = [*names, ""], expected + 1
        repairs.append(Repair("separator at the end of the rows ignored", where, int(trailing.sum()), "info"))
    bad = counts != expected
    n_bad = int(bad.sum())
    if n_bad > max(1, _MAX_DAMAGED * len(counts)) or n_bad == len(counts):
        row = int(np.argmax(bad))
        raise InputError(
            f"{where}: {n_bad} of {len(counts)} rows do not have {len(names)} cells, first row {row + 1} "
            f"with {counts[row] + 1}: is the separator '{separator}' also used inside the cells?"
        )
    if n_bad:
        lost = 100.0 * n_bad / len(counts)
        last = " (the last row is cut short)" if bad[-1] and not body.endswith(b"\n") else ""
        words = f"rows with the wrong number of cells left out, {lost:.2g} % of the file{last}"
        repairs.append(Repair(words, where, n_bad, "warning", "export the file again if rows matter"))
        lines = body.split(b"\n")
        body = b"\n".join(line for line, wrong in zip(lines, bad, strict=False) if not wrong)
    return body, names
