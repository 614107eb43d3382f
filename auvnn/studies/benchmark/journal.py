"""The rows of an unfinished benchmark on disk: one line for each finished log, from which a later run goes on."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import auvnn
from auvnn.answers import plain
from auvnn.errors import InputError
from auvnn.studies.benchmark.cases import Case

# These floors draw and talk; what they do cannot change a row.
ASIDE = ("report", "cli")


def code_fingerprint() -> str:
    """Return twelve digits that change with the code that makes a row."""
    root = Path(auvnn.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in ASIDE:
            digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


# What ends each line: the beginning of the SHA-256 of the row without it. A flipped bit in a number is another number.
_SUM = re.compile(rb', "sum": "([0-9a-f]{16})"\}\s*$')


def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()[:16]


def _checked(line: bytes, summed: bool) -> bytes:
    """Return a line's row without its checksum; rows of a file in which none has one are taken as they are.

    Raises:
        ValueError: it is damaged.
    """
    found = _SUM.search(line)
    if found is None:
        if summed:
            raise ValueError("no checksum")
        return line
    text = line[: found.start()] + b"}"
    if _digest(text).encode() != found[1]:
        raise ValueError("another checksum")
    return text


class Journal:
    """Rows as lines of JSON, each written whole and flushed to the disk before the next log is waited for.

    Args:
        path: of the file; its folder is made when the first row is written.
        code: fingerprint of the code that makes the rows.
    """

    def __init__(self, path: str | Path, code: str | None = None) -> None:
        """Keep the place; nothing is read or written yet."""
        self.path = Path(path)
        self.code = code_fingerprint() if code is None else code

    def rows(self, todo: Iterable[Case], *, any_code: bool = False) -> dict[Case, dict[str, Any]]:
        """Return the rows that are there already, of the cases that are to be done.

        Rows that other code made are left alone unless `any_code`; of two for one case, the later counts. A
        last line that was cut short by a kill is passed over.

        Raises:
            InputError: a line in the middle is no row.
        """
        if not self.path.exists():
            return {}
        wanted, found = set(todo), {}
        lines = self.path.read_bytes().split(b"\n")
        summed = any(_SUM.search(line) for line in lines)
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                row = json.loads(_checked(line, summed))
                case = Case.of_row(row)
            except (ValueError, TypeError, AttributeError):
                if number == len(lines):
                    break
                raise InputError(
                    f"{self.path}: line {number} is no row of a benchmark, or damaged: take it out, or name another out="
                ) from None
            if case in wanted and (any_code or row.get("code") == self.code):
                found[case] = row
        return found

    def append(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Write one row with the fingerprint in it, and return it as it will be read."""
        data = plain({**row, "code": row.get("code") or self.code})
        text = json.dumps(data, allow_nan=False)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with open(self.path, "ab+") as stream:
            if stream.tell() > 0:
                stream.seek(-1, os.SEEK_END)
                if stream.read(1) != b"\n":
                    # What a killed run left unfinished: nobody can read on from the middle of a line.
                    self._repair(stream)
            stream.write(f'{text[:-1]}, "sum": "{_digest(text.encode())}"}}\n'.encode())
            stream.flush()
            os.fsync(stream.fileno())
        return json.loads(text)

    @staticmethod
    def _repair(stream: Any) -> None:
        stream.seek(0)
        whole = stream.read().rfind(b"\n") + 1
        stream.truncate(whole)
        stream.seek(0, os.SEEK_END)
