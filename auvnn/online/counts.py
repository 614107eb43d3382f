"""How often an adapter did what."""

from __future__ import annotations

from dataclasses import dataclass, field

from auvnn.online.guards import REASONS


@dataclass
class Counts:
    """How often what happened."""

    samples: int = 0
    adapted: int = 0
    shortened: int = 0
    reverted: int = 0
    validated: int = 0
    believed: int = 0
    proven: int = 0
    skipped: dict[str, int] = field(default_factory=lambda: dict.fromkeys(REASONS, 0))
