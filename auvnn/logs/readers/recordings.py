"""What formats of many topics have in common: they are looked through first, then merged by a mapping."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from auvnn.logs.readers.base import Reader, Table
from auvnn.logs.recording import Recording, Wanted

if TYPE_CHECKING:
    from auvnn.logs.reading.mapping_file.mapping import Mapping as Plan


class RecordingReader(Reader):
    """A format of topics with times of their own."""

    in_parts: ClassVar[bool] = False
    extra_definitions: Mapping[str, Any] = MappingProxyType({})
    """Definitions of message types that the file does not carry."""

    @abstractmethod
    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the topics that are wanted, all of them where None, and their first `until` seconds.

        Raises:
            InputError: the file is damaged or holds no messages; no other error may leave a reader.
        """

    def survey(self, path: Path) -> Recording:
        """Return what topics there are and how fast, from as much of the file as that takes.

        Raises:
            InputError: as `record`.
        """
        return self.record(path)

    def read(self, path: Path) -> Table:
        """Read what is known of the message types, without a mapping.

        Raises:
            InputError: as `record`, or the known types hold no log.
        """
        from auvnn.logs.reading.mapping_file.mapping import Mapping as Changes

        return self.mapped(path, Changes())

    def mapped(self, path: Path, plan: Plan, share: float = 1.0, until: float | None = None) -> Table:
        """Return the canonical table that a mapping makes of the topics.

        Raises:
            InputError: as `record`; a topic or field of the mapping is not there.
        """
        from auvnn.logs.reading.recordings.assemble import assemble

        return assemble(self, path, plan, until)

    def mapped_rows(self, path: Path, plan: Plan, first: int, count: int) -> Table:
        """Return some of the rows of the table that `mapped` makes of all.

        Raises:
            InputError: as `mapped`.
        """
        whole = self.mapped(path, plan)
        part = slice(first, first + count)
        columns = {name: column[part] for name, column in whole.columns.items()}
        rows = len(range(*part.indices(whole.rows)))
        return Table(columns, rows, {}, set(whole.seconds), list(whole.repairs), whole.rest)
