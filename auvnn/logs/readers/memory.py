"""A log that does not fit into memory is refused before it is read, not killed while it is."""

from __future__ import annotations

import os
from pathlib import Path

from auvnn.errors import InputError


def available_bytes() -> int | None:
    """Return the memory that can be had without swapping, or None where the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError, IndexError):
        return None


def refuse_more_than_memory(needed: int, where: str) -> None:
    """Refuse a file that needs more memory than there is.

    Args:
        needed: bytes that reading takes.
        where: the file, for the message.

    Raises:
        InputError: it does not fit.
    """
    free = available_bytes()
    if free is not None and needed > 0.8 * free:
        raise InputError(
            f"{where}: reading needs about {needed / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are free: "
            "read its beginning alone with max_duration=, split the log into runs, or export fewer columns"
        )
