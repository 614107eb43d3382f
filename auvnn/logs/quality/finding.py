"""One thing that a person should know about a log."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from auvnn.logs.reading.repairs.repair import Level


@dataclass(frozen=True)
class Finding:
    """One thing worth knowing.

    Args:
        level: "error" forbids fitting, "warning" asks for care, "repair" was corrected, "info" is a note.
        where: channel, run or file, or a word for the subject ("excitation", "time").
        what: what is the case.
        cure: what to do about it, "" where nothing need be done.
    """

    level: Level
    where: str
    what: str
    cure: str = ""

    def to_dict(self) -> dict[str, str]:
        """Return the entry of the quality answer."""
        return asdict(self)
