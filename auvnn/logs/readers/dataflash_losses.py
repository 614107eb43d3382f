"""What an ArduPilot log says of its own losses: messages that the logger dropped, positions that the estimator reset."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Topic

Array = NDArray[np.float64]
# Metres that a position jumps, below which nobody notices.
_JUMP = 0.01


def losses(topics: Mapping[str, Callable[[], Mapping[str, Topic]]], where: str) -> list[Repair]:
    """Return findings on dropped messages (DSF) and on resets of the position (XKF4, NKF4).

    `DSF.Dp` counts what the logger has dropped since it began; `OFN` and `OFE` are the latest reset's shift, north and
    east, m.

    Args:
        topics: message name to what returns its topics, one for each instance or core.
        where: the file.
    """
    found = []
    if "DSF" in topics:
        dropped = sum(_total(_field(topic, "Dp")) for topic in topics["DSF"]().values())
        if dropped:
            words = "messages dropped by the vehicle's logger (DSF.Dp): what they held is missing"
            found.append(Repair(words, where, dropped, "warning", "log less, or to a faster card"))
    for name in ("XKF4", "NKF4"):
        jumps = [_jumps(topic) for topic in topics[name]().values()] if name in topics else []
        sizes = np.concatenate([np.zeros(0), *jumps])
        if len(sizes):
            words = f"resets of the estimator's position ({name}), by up to {sizes.max():.3g} m"
            cure = f"say reset: {{from: {name}.OFN}} in the mapping, so that nothing is joined there"
            found.append(Repair(words, where, len(sizes), "warning", cure))
    return found


def _jumps(topic: Topic) -> Array:
    """Return the sizes of the resets that one core tells of, m."""
    north, east = (_field(topic, n) for n in ("OFN", "OFE"))
    if len(north) != len(east) or len(north) < 2:
        return np.zeros(0)
    with np.errstate(all="ignore"):
        size = np.hypot(np.diff(north), np.diff(east))
    return size[np.isfinite(size) & (size > _JUMP)]


def _field(topic: Topic, name: str) -> Array:
    """Return a field's finite numbers, (N,); nothing where the message has none of that name."""
    values = np.asarray(topic.columns.get(name, np.zeros(0)), dtype=np.float64)
    return np.where(np.isfinite(values), values, 0.0)


def _total(counter: Array) -> int:
    """Return what a counter has counted, which begins anew where the vehicle was started again."""
    if not len(counter):
        return 0
    steps = np.diff(counter)
    return int(counter[0] + steps[steps > 0].sum() + counter[1:][steps < 0].sum())
