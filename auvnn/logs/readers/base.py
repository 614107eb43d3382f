"""What every log format hands over: a table of named numbers, and what was noted while reading it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.reading.repairs.repair import Repair

if TYPE_CHECKING:
    from auvnn.logs.reading.mapping_file.mapping import Mapping


@dataclass
class Text:
    """A column that is not numbers.

    Args:
        bad: where the first cell that is no number stands, and what it says.
        codes: number of the label in each row, (N,), -1 for an empty cell; None where labels abound.
        labels: the labels in the order of their first appearance.
    """

    bad: str
    codes: NDArray[np.intp] | None = None
    labels: Sequence[str] = ()

    def __getitem__(self, rows: slice) -> Text:
        """Return some of the rows."""
        return Text(self.bad, None if self.codes is None else self.codes[rows], self.labels)


@dataclass
class Table:
    """Columns under the names they have in the file.

    Args:
        columns: name to float64 (N,), NaN for a missing cell; int64 where a float would lose digits.
        rows: N.
        text: columns that are not numbers.
        seconds: names of columns that already hold seconds, because the file stored dates or durations.
        repairs: what the reader corrected or noted.
        rest: what is left of the mapping to be done with the rows; None for the mapping that was given.
        sha256: of the file's bytes, where the reader had all of them; empty elsewhere.
        checked: whether the file carries checksums of all its numbers, and they were compared.
    """

    columns: dict[str, NDArray[Any]]
    rows: int
    text: dict[str, Text] = field(default_factory=dict)
    seconds: set[str] = field(default_factory=set)
    repairs: list[Repair] = field(default_factory=list)
    rest: Mapping | None = None
    sha256: str = ""
    checked: bool = False

    @property
    def names(self) -> list[str]:
        """All names, of numbers and of text."""
        return [*self.columns, *self.text]


class Reader(ABC):
    """One file format; add one by putting a class like this into the catalogue of readers."""

    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    in_parts: ClassVar[bool] = True
    """Whether some of its rows can be read without the others."""

    @abstractmethod
    def recognises(self, head: bytes) -> bool:
        """Say from the first bytes of a file (at most 4096) whether it has this format."""

    @abstractmethod
    def read(self, path: Path) -> Table:
        """Read the whole file.

        Raises:
            InputError: it is damaged or holds no table; no other error may leave a reader.
        """

    def read_head(self, path: Path, share: float) -> Table:
        """Read about a share of the file from its beginning; a format that cannot do so reads all of it.

        Raises:
            InputError: as `read`.
        """
        return self.read(path)

    def mapped(self, path: Path, plan: Mapping, share: float = 1.0, until: float | None = None) -> Table:
        """Return the table under canonical names, the whole of it or about a share from its beginning.

        Args:
            path: the file.
            plan: the mapping.
            share: of the file to read.
            until: s after the first stamp; what comes later may be left out already here.

        Raises:
            InputError: as `read`, or what the mapping names is not there.
        """
        return plan.apply(self.read(path) if share >= 1.0 else self.read_head(path, share), str(path))

    def mapped_rows(self, path: Path, plan: Mapping, first: int, count: int) -> Table:
        """Return some of the rows under canonical names.

        Args:
            path: of the file.
            plan: the mapping.
            first: number of the first row, from 0.
            count: of rows.

        Raises:
            InputError: as `mapped`.
        """
        return plan.apply(self.read_rows(path, first, count), str(path))

    def rows(self, path: Path) -> int:
        """Return how many rows the file has; a format that does not say reads all of it.

        Raises:
            InputError: as `read`.
        """
        return _whole(self, path).rows

    def read_rows(self, path: Path, first: int, count: int) -> Table:
        """Read some of the rows; a format that cannot seek reads all of them, and remembers them for the next call.

        Columns that hold dates count their seconds from the file's first row, whichever rows are read.

        Args:
            path: of the file.
            first: number of the first row, from 0.
            count: of rows.

        Raises:
            InputError: as `read`.
        """
        whole = _whole(self, path)
        part = slice(first, first + count)
        columns = {name: column[part] for name, column in whole.columns.items()}
        text = {name: column[part] for name, column in whole.text.items()}
        return Table(columns, len(range(*part.indices(whole.rows))), text, set(whole.seconds), [])

    def verify(self, path: Path) -> None:
        """Compare the file with what it states of itself, before it is read in parts, which cannot show that.

        Raises:
            InputError: it is damaged.
        """
        return

    def first_stamp(self, path: Path, column: str) -> float | None:
        """Return the date in a column's first row, s since 1970; None where the column holds no dates.

        Raises:
            InputError: as `read`.
        """
        return None


def _whole(reader: Reader, path: Path) -> Table:
    """Return a file's whole table; the last one is kept for as long as the file does not change."""
    state = path.stat()
    key = (reader.name, str(path), state.st_size, state.st_mtime_ns)
    if key not in _KEPT:
        _KEPT.clear()
        _KEPT[key] = reader.read(path)
    return _KEPT[key]


_KEPT: dict[tuple[str, str, int, int], Table] = {}
