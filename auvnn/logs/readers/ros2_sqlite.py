"""The other container of ROS 2: an SQLite file with a table of topics and a table of messages."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import quote

from auvnn.errors import InputError, one_line
from auvnn.logs.readers.ros import Channel, Message, Notes, RosReader
from auvnn.logs.reading.repairs.repair import Repair

_LONGEST_MESSAGE = 100_000_000
_PATIENCE = 5.0  # s that a damaged file may keep SQLite busy without yielding a message


class Ros2SqliteReader(RosReader):
    """ROS 2 messages in sqlite3 (`.db3`)."""

    name = "rosbag2-sqlite3"
    suffixes = (".db3",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as SQLite does."""
        return head.startswith(b"SQLite format 3\0")

    def messages(
        self, path: Path, wanted: Callable[[Channel], bool], most: int | None, notes: Notes
    ) -> Iterator[Message]:
        """Yield messages as they lie in the file, which is only read."""
        where = str(path)
        wal = path.with_name(path.name + "-wal")
        # A recorder that was killed leaves its last messages in this file; without it they are lost.
        left = "" if wal.exists() and wal.stat().st_size else "&immutable=1"
        patience = [time.monotonic()]
        taken = 0
        try:
            bag = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro{left}", uri=True)
        except sqlite3.Error as problem:
            raise InputError(f"{where}: cannot be opened: {one_line(problem, 120)}") from None
        try:
            bag.text_factory = lambda raw: raw.decode("utf-8", "replace")
            bag.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_MESSAGE)
            bag.execute("PRAGMA trusted_schema=OFF")
            bag.execute("PRAGMA cell_size_check=ON")
            bag.set_progress_handler(lambda: time.monotonic() - patience[0] > _PATIENCE, 100_000)
            channels = _channels(bag, wanted, where)
            if not channels:
                return
            marks = ",".join("?" * len(channels))
            rows = bag.execute(
                f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})", list(channels)
            )
            for number, stamp, data in rows:
                patience[0] = time.monotonic()
                if not isinstance(data, bytes) or not isinstance(stamp, int):
                    raise sqlite3.DatabaseError("a message is no bytes")
                yield channels[number], stamp, data
                taken += len(data)
                if most is not None and taken > most:
                    return
        except (sqlite3.Error, OverflowError, ValueError) as problem:
            if not taken:
                raise InputError(f"{where}: is no ROS 2 bag, or damaged: {one_line(problem, 120)}") from None
            words = f"damaged: what comes after {taken / 1e6:.1f} MB of messages left out ({one_line(problem, 60)})"
            notes.append(Repair(words, where, 1, "warning", "copy the bag again"))
        finally:
            bag.close()


def _channels(bag: sqlite3.Connection, wanted: Callable[[Channel], bool], where: str) -> dict[int, Channel]:
    found = {r[0] for r in bag.execute("SELECT name FROM sqlite_master WHERE type='table'")}
    if not {"topics", "messages"} <= found:
        raise InputError(
            f"{where}: is an SQLite file, but no ROS 2 bag: it has no tables 'topics' and 'messages'"
        )
    texts = {}
    if "message_definitions" in found:
        rows = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        texts = {str(k): (str(text or ""), encoding == "ros2idl") for k, encoding, text in rows}
    channels = {}
    for number, name, kind, form in bag.execute("SELECT id, name, type, serialization_format FROM topics"):
        channel = Channel(str(name), str(kind), *texts.get(str(kind), ("", False)))
        if form == "cdr" and isinstance(number, int) and wanted(channel):
            channels[number] = channel
    return channels
