"""Stamps that are dates, counted from the beginning of their recording.

What depends on time in a model (a payload that is picked up, water that leaks in, waves) counts it on the log's clock.
A clock that shows seconds since 1970 would put every onset 1.7e9 s away, where a slope in frequency or rate means
nothing and a float64 resolves a quarter of a microsecond. Dates in date columns and in recordings are counted from the
beginning of their file already; numbers that can only be dates are treated alike.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run

Array = NDArray[np.float64]

DATED = 1e7
"""s: no clock that counts from the start of a recording or of a computer has run for four months."""
_DECIMALS = 6  # a float64 of today's date holds microseconds, and no more


def origin_of(t: Array) -> float:
    """Return the whole second from which stamps are counted: zero, or the second of the first one where it is a date.

    Args:
        t: stamps in the order of the file, s, (N,); NaN and zeros before the clock started are passed over.
    """
    seen = np.flatnonzero(np.isfinite(t) & (t != 0.0))
    first = float(t[seen[0]]) if len(seen) else 0.0
    return float(np.floor(first)) if first >= DATED else 0.0


def counted_from(t: Array, origin: float) -> Array:
    """Return stamps counted from an origin, s, (N,), without the digits that a date has lost.

    A date in s resolves 2.4e-7 s. A stamp that is the nearest number to a whole microsecond is taken for that
    microsecond, so that even steps are even again; any other is left as it is.
    """
    if origin == 0.0:
        return t
    since = t - origin
    whole = np.round(since, _DECIMALS)
    # Below half a step between numbers: no two stamps fall on the same microsecond.
    return np.where(np.abs(whole - since) < 0.499 * np.spacing(origin), whole, since)


def note(origin: float, where: str, count: int) -> Repair:
    """Return what the reader of the log should know.

    Args:
        origin: what was taken off the stamps, s.
        where: file, or name of the log.
        count: of the stamps.
    """
    words = (
        f"t counts from {origin:.0f} s, since the stamps are dates: it is s since the recording's beginning"
    )
    return Repair(words, where, count, "info")


def from_their_beginning(runs: Iterable[Run], name: str) -> tuple[tuple[Run, ...], tuple[Repair, ...]]:
    """Return the runs of a log on one clock that begins near zero, and what should be reported about it.

    Args:
        runs: stamped by one clock; they are returned as they are where it shows no dates.
        name: of the log.
    """
    runs = tuple(runs)
    origin = origin_of(np.array([min((float(run.t[0]) for run in runs), default=0.0)]))
    if not origin:
        return runs, ()
    moved = tuple(_moved(run, origin) for run in runs)
    return moved, (note(origin, name, sum(run.samples for run in runs)),)


def _moved(run: Run, origin: float) -> Run:
    recorded = None if run.recorded is None else _moved(run.recorded, origin)
    return replace(run, t=counted_from(run.t, origin), recorded=recorded)
