"""What of a log is fitted on and what is held out, the same on both sides of the page."""

from __future__ import annotations

from auvnn.errors import AuvnnError
from auvnn.logs import Log


def split(log: Log) -> tuple[Log, Log | None, str]:
    """Return what to fit on and what is held out, or all and nothing where the log is too short to be divided."""
    try:
        return log.split()
    except AuvnnError as problem:
        return log, None, str(problem)
