"""What was corrected, noted or doubted while a log was read: counted, never silent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["error", "warning", "repair", "info"]
LEVELS: tuple[Level, ...] = ("error", "warning", "repair", "info")


@dataclass(frozen=True)
class Repair:
    """One kind of change or note made while reading.

    Args:
        what: what was done, in plain words, without the count.
        where: file, run and column.
        count: number of samples, rows or columns concerned.
        level: "repair" where data were changed, "warning" where they are doubted, "info" for a note.
        cure: how to get rid of it, empty where nothing need be done.
    """

    what: str
    where: str
    count: int
    level: Level = "repair"
    cure: str = ""

    def __str__(self) -> str:
        """Return one line for a person."""
        return f"{self.where}: {self.what} ({self.count})"

    def to_dict(self) -> dict[str, object]:
        """Return the entry of the quality answer."""
        return {"what": self.what, "where": self.where, "count": self.count, "level": self.level}
