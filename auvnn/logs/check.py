"""The quality report of a log or of files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from auvnn.logs.log import Log
from auvnn.logs.quality.quality import Quality


def check(log: Log | str | Path | Sequence[str | Path] | Mapping[str, Any], mapping: Any = None) -> Quality:
    """Return the quality report of a log, or of the files that it is to be read from.

    Args:
        log: a log, a file that a reader knows, a list of such files, or a table in memory.
        mapping: for files, how their columns are named; see `Log.read`.
    """
    if isinstance(log, Mapping) or (hasattr(log, "columns") and not isinstance(log, Log)):
        return Log.from_dataframe(log, mapping).quality()
    return (log if isinstance(log, Log) else Log.read(log, mapping)).quality()
