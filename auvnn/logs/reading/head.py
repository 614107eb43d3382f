"""The first seconds of a long recording: no more of the file is read than it takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ConfigError, InputError
from auvnn.logs.readers import Reader, Table
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.signals.segments import GAP_STEPS

_FIRST = 64_000_000  # bytes of the file with which to begin
_MORE = 4.0


def read_table(
    reader: Reader, path: Path, plan: Mapping, max_duration: float | None
) -> tuple[Table, int | None]:
    """Return a file's table under canonical names, the whole of it or its first seconds.

    Gaps do not count as time, nor do steps back. Of a long file ever larger parts are read until one is long
    enough, so that memory is needed for what is kept and not for the file.

    Args:
        reader: of the file's format.
        path: the file.
        plan: the mapping.
        max_duration: s to keep; None for all.

    Returns:
        The table, and the number of bytes that were read for it; None where that was the whole file.

    Raises:
        InputError: the file cannot be read.
        ConfigError: `max_duration` is no positive number.
    """
    where = str(path)
    if max_duration is None:
        return reader.mapped(path, plan), None
    number = isinstance(max_duration, (int, float)) and not isinstance(max_duration, bool)
    if not number or not 0.0 < max_duration < np.inf:
        raise ConfigError(f"max_duration={max_duration} must be a number of seconds above zero")
    try:
        size = path.stat().st_size
        share = min(1.0, _FIRST / max(size, 1)) if reader.in_parts else 1.0
    except OSError as problem:
        raise InputError(f"{where}: cannot be read: {problem}") from None
    while True:
        table = reader.mapped(path, plan, share, max_duration)
        read = None if share >= 1.0 else int(share * size)
        if "t" not in table.columns:
            return table, read  # the check of what is required has better words for it
        elapsed = _elapsed(plan.seconds(table.columns["t"], "t" in table.seconds))
        if share >= 1.0 or elapsed[-1] > max_duration:
            break
        share = min(1.0, _MORE * share)
    rows = int(np.searchsorted(elapsed, max_duration, side="right"))
    if rows == table.rows and share >= 1.0:
        return table, read
    kept = 100.0 * share * rows / table.rows
    words = (
        f"the first {max_duration:g} s read, about {kept:.2g} % of the file; the rest left out (max_duration)"
    )
    table.columns = {name: column[:rows] for name, column in table.columns.items()}
    table.text = {name: column[:rows] for name, column in table.text.items()}
    table.rows = rows
    table.repairs.append(Repair(words, where, rows, "info"))
    return table, read


def _elapsed(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the recorded time up to each row, s, (N,): no gaps, no steps back, no missing stamps."""
    steps = np.diff(t)
    steps = np.where(np.isfinite(steps) & (steps > 0.0), steps, 0.0)
    usual = GAP_STEPS * float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    return np.concatenate([[0.0], np.cumsum(np.where(steps <= usual, steps, 0.0))])
