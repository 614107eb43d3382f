"""A file's bytes without mapping it into memory: a file that is cut short meanwhile is an error, not the end of all.

A memory map of a file that shrinks ends the process with SIGBUS, which nothing can catch. Decoders map what they are
given by name, so they are given memory, or a nameless copy of the parts that they need.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from auvnn.errors import InputError

BLOCK = 1 << 16
_COPY = 1 << 24


class FileBytes:
    """Reads slices of a file, as if it were a bytes object; bytes close to each other come from one block."""

    def __init__(self, stream: BinaryIO, where: str) -> None:
        """Take an open file and its name for messages."""
        self.stream, self.where = stream, where
        self.size = stream.seek(0, os.SEEK_END)
        self._start, self._block = 0, b""

    def __len__(self) -> int:
        """Return the size that the file had."""
        return self.size

    def __getitem__(self, part: slice) -> bytes:
        """Return some of the bytes.

        Raises:
            InputError: the file has become shorter.
        """
        start, stop, _ = part.indices(self.size)
        if not (self._start <= start and stop <= self._start + len(self._block)):
            self._start, self._block = start, self._read(start, max(stop, min(start + BLOCK, self.size)))
        found = self._block[start - self._start : max(stop, start) - self._start]
        if len(self._block) > 4 * BLOCK:
            self._start, self._block = 0, b""  # a large page is not kept
        return found

    def _read(self, start: int, stop: int) -> bytes:
        self.stream.seek(start)
        found = self.stream.read(stop - start)
        if len(found) < stop - start:
            raise InputError(f"{self.where}: became shorter while it was read; wait until the copy is done")
        return found


@contextlib.contextmanager
def excerpt(path: Path, ranges: Iterable[tuple[int, int]]) -> Iterator[str | Path]:
    """Give the name of a copy in which some ranges of a file's bytes stand at their places, and zeros elsewhere.

    Zeros that were never written take no memory. Where the system has no nameless files, the file itself is given.

    Args:
        path: the file.
        ranges: first byte, and first byte behind.

    Raises:
        InputError: the file has become shorter.
    """
    if not hasattr(os, "memfd_create") or not os.path.isdir("/proc/self/fd"):
        yield path
        return
    with path.open("rb") as stream, open(os.memfd_create("auvnn-log"), "r+b", buffering=0) as copy:
        source = FileBytes(stream, str(path))
        copy.truncate(source.size)
        for start, stop in ranges:
            for at in range(start, stop, _COPY):
                copy.seek(at)
                copy.write(source._read(at, min(at + _COPY, stop)))
        yield f"/proc/self/fd/{copy.fileno()}"
