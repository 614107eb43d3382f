"""PX4's ULog, read by pyulog.

https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import InputError, MissingExtra
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_MAGIC = b"ULog\x01\x12\x35"


class UlogReader(RecordingReader):
    """Topics of PX4, several instances of one as `battery_status[1]`."""

    name = "ulog"
    suffixes = (".ulg",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as ULog does."""
        return head.startswith(_MAGIC)

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the topics that are wanted."""
        where = str(path)
        try:
            from pyulog import ULog
        except ImportError:
            raise MissingExtra("pyulog", "px4", "reading ULog files") from None
        try:
            # It prints what it finds damaged.
            with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
                log: Any = ULog(str(path))
                notes, topics, facts = _contents(log, where, wanted)
        except MemoryError:
            raise InputError(f"{where}: is a damaged ULog: it asks for more memory than there is") from None
        except Exception as problem:  # it indexes, unpacks and looks up what the file says
            raise InputError(
                f"{where}: is a damaged ULog ({type(problem).__name__}); copy it again"
            ) from None
        if not topics and wanted is None:
            raise InputError(f"{where}: holds no messages")
        return Recording(topics, notes, facts)


def _contents(
    log: Any, where: str, wanted: Wanted | None
) -> tuple[list[Repair], dict[str, Topic], dict[str, Any]]:
    """Return notes, topics and facts of a parsed log; whatever it raises is damage."""
    notes: list[Repair] = []
    if log.file_corruption:
        notes.append(Repair("damaged parts left out", where, 1, "warning", "copy the log again"))
    if log.dropouts:
        lost = sum(d.duration for d in log.dropouts) / 1000.0
        words = f"times at which the logger could not keep up, {lost:.2g} s together"
        notes.append(Repair(words, where, len(log.dropouts), "warning"))
    several = {d.name for d in log.data_list if d.multi_id}
    start = int(log.start_timestamp)
    topics = {}
    for data in log.data_list:
        name = f"{data.name}[{data.multi_id}]" if data.name in several else data.name
        topic = _topic(name, data.data, start)
        if topic is not None and (wanted is None or wanted(name, "ulog")):
            topics[name] = topic
    facts = {
        "parameters": {k: float(v) for k, v in log.initial_parameters.items() if isinstance(v, (int, float))}
    }
    return notes, topics, facts


def _topic(name: str, columns: dict[str, Any], start: int) -> Topic | None:
    if "timestamp" not in columns or len(columns["timestamp"]) == 0:
        return None
    stamps = columns["timestamp"]
    sampled = columns.get("timestamp_sample")
    # When it was measured, where the message says so, not when it was published.
    if sampled is not None and (np.abs(sampled.astype(np.int64) - stamps.astype(np.int64)) < 2_000_000).all():
        stamps = sampled
    t = (stamps.astype(np.int64) - start) * 1e-6
    with np.errstate(all="ignore"):
        numbers = {
            k: v.astype(np.float64)
            for k, v in columns.items()
            if getattr(v, "dtype", np.dtype("O")).kind in "iufb" and not k.startswith("timestamp")
        }
    return Topic(name, "ulog", t, numbers)
